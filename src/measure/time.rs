//! Times over many samples: median and quartiles; what was not measured stays that.

use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    pub median: f64,
    pub lower_quartile: f64,
    pub upper_quartile: f64,
    pub samples: usize,
}

/// `None` if no sample was measured.
pub fn spread(mut samples: Vec<f64>) -> Option<Spread> {
    if samples.is_empty() {
        return None;
    }
    samples.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = share * (samples.len() - 1) as f64;
        let low = samples[place.floor() as usize];
        low + (samples[place.ceil() as usize] - low) * place.fract()
    };
    Some(Spread { median: at(0.5), lower_quartile: at(0.25), upper_quartile: at(0.75), samples: samples.len() })
}
