//! Every stage of the registry against its f64 reference on the first adapter, one test a scene (`lodlab check` does all adapters).

use libtest_mimic::{Arguments, Failed, Trial};
use lodlab::check::{self, Outcome, cases};
use lodlab::gpu::Gpu;
use lodlab::stages::REGISTRY;

fn main() {
    let cases = cases::cases(None).unwrap_or_else(|error| panic!("{error}"));
    let trials = cases.into_iter().map(|case| Trial::test(case.name.clone(), move || agrees(&case)));
    let more = [
        Trial::test("every buffer of every stage is compared", every_buffer_is_compared),
        Trial::test("a block of many tiles has the roughness of all of them", many_tiles_are_all_gathered),
    ];
    let all = trials.chain(more).collect();
    libtest_mimic::run(&Arguments::from_args(), all).exit();
}

fn agrees(case: &cases::Case) -> Result<(), Failed> {
    let outcomes = check::run_case(&Gpu::open(None)?, case)?;
    let failed: Vec<String> =
        outcomes.iter().filter(|outcome| !outcome.passed()).map(|outcome| outcome.to_string()).collect();
    if failed.is_empty() { Ok(()) } else { Err(failed.join("\n").into()) }
}

fn every_buffer_is_compared() -> Result<(), Failed> {
    // one of them from outside, where no rays are led, one from inside, and one over octaves
    let scenes = [
        "anisotropic Triangles",
        "slow Triangles",
        "gentle Triangles",
        "octaves Triangles",
        "octaves coloured Triangles",
    ];
    let gpu = Gpu::open(None)?;
    let mut outcomes = Vec::new();
    for case in cases::cases(None)?.iter().filter(|case| scenes.contains(&case.name.as_str())) {
        outcomes.extend(check::run_case(&gpu, case)?);
    }
    for entry in REGISTRY {
        let info = entry.info;
        let of_stage: Vec<&Outcome> = outcomes.iter().filter(|outcome| outcome.stage == info.name).collect();
        let compared: usize = of_stage.iter().map(|outcome| outcome.local.compared).sum();
        // the fewest are of LeadRays, which has one for 64 pixels
        assert!(compared > 100, "{} is not checked: {compared} values", info.name);
        // stages whose buffers are named by their parameters have other names in their examples
        let is_named = !["Scan", "Compact"].contains(&info.name);
        for buffer in info.writes.iter().filter(|_| is_named) {
            let is_unchecked = info.unchecked.iter().any(|(name, _)| name == buffer);
            let is_compared = of_stage.iter().any(|outcome| outcome.buffer == *buffer && outcome.local.compared > 0);
            assert!(is_compared || is_unchecked, "`{buffer}` of {} is compared nowhere", info.name);
        }
    }
    Ok(())
}

/// Adapters have been seen to end the loops of a thread after 65535 turns in all, and the coarsest block has more tiles. What it is
/// farthest from is near the end of this terrain.
fn many_tiles_are_all_gathered() -> Result<(), Failed> {
    let terrain = "Shape(kind: Sine, size: (1040, 16384), cell_m: 10, height_m: (0, 1000), period_cells: 30000)";
    let examples = REGISTRY.iter().flat_map(|entry| entry.info.examples);
    agrees(&cases::Case {
        name: "many tiles".into(),
        scene: format!("terrain: {terrain}, camera: Still(eye: (5000, -3000, 5000), pitch_deg: -30), viewport: (8, 8)"),
        examples: examples.filter(|example| example.chain == "[Roughness(error: Proven)]").collect(),
    })
}
