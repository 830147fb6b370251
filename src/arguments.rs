//! What can be written on the command line.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

/// Experiments with GPU terrain level of detail: error against run time.
#[derive(Parser)]
#[command(version, about)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Runs experiments; finished cells are not run again
    Run(Running),
    /// Shows what would run, what is left out and why, buffers and bytes; needs no device
    Plan {
        file: PathBuf,
        #[arg(long = "set", value_name = "PATH=VALUE")]
        set: Vec<String>,
    },
    /// Lists the cells of an experiment, one JSON object a line; needs no device
    Cells(CellList),
    /// Makes tables, plot and page from the finished cells of one or several folders; needs no device
    Report(Reporting),
    /// Compares two folders of results cell by cell: faster, slower, other figures
    Compare(Comparing),
    /// Says what each column of the records is
    Schema,
    /// Lists stages, measures, terrains and cameras, or explains one
    Stages { name: Option<String> },
    /// Compares every stage with its f64 reference on ordinary and extreme input
    Check {
        /// Only this stage, on its own examples
        stage: Option<String>,
        /// The adapter whose name contains this [default: every adapter]
        #[arg(long, value_name = "NAME")]
        adapter: Option<String>,
    },
    /// Looks for scenes in which a promise is broken (a proven bound, a closed mesh, the truth, the same bits twice), and writes what it finds
    Hunt(Hunting),
    /// Shows every buffer of an experiment in a window; without a file, the experiments that ship
    Inspect(Inspect),
    /// Lists the adapters
    Devices,
}

#[derive(clap::Args)]
pub struct Running {
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Sets a parameter: chain.Stage.field=value, *.Stage.field=value, scene.field=value; several values (a,b,c) make an axis
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub set: Vec<String>,
    /// Folder for the results [default: out/NAME for each experiment]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// The adapter whose name contains this
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Frames of the camera path, instead of what the file says
    #[arg(long, value_name = "N")]
    pub frames: Option<u32>,
    /// Writes a buffer of every frame as .npy: as the frame leaves it, or as it is after a step (a stage, a label, or STAGE/LABEL)
    #[arg(long, value_name = "BUFFER[@STEP]")]
    pub dump: Vec<String>,
    /// Puts a look of a buffer into the page, named as for --dump; of the frame in the middle of the path
    #[arg(long, value_name = "BUFFER[@STEP]")]
    pub picture: Vec<String>,
    /// Makes these pictures of every frame
    #[arg(long, requires = "picture")]
    pub every_frame: bool,
    /// Keeps the pictures of every cell; else a sweep of more than 200 cells keeps those of its front
    #[arg(long)]
    pub all_pictures: bool,
    /// Computes a stage in f64 on the CPU and gives its result to the kernels after it; `Stage#2` is the second of a name
    #[arg(long, value_name = "STAGE")]
    pub on_cpu: Vec<String>,
    /// Runs finished cells again
    #[arg(long)]
    pub force: bool,
    /// Runs what the plan would leave out, too
    #[arg(long)]
    pub keep_everything: bool,
    /// The chain that tables compare the others with [default: the file's `baseline`, or the first]
    #[arg(long, value_name = "CHAIN")]
    pub baseline: Option<String>,
    /// Runs one part of n of the cells: every n-th, from the i-th
    #[arg(long, value_name = "I/N", value_parser = read_shard)]
    pub shard: Option<Shard>,
    /// Runs the cells in a file, one a line as `lodlab cells` prints them; `-` is standard input
    #[arg(long, value_name = "FILE")]
    pub cells: Option<PathBuf>,
    /// Says nothing while it runs but warnings and failures
    #[arg(long)]
    pub quiet: bool,
    /// Says what happens as one JSON object a line, for programs
    #[arg(long, conflicts_with = "quiet")]
    pub json: bool,
    /// Ends the run when the device works on one submission, or its driver on one kernel, for longer than that
    #[arg(long, value_name = "SECONDS", default_value_t = 120, value_parser = clap::value_parser!(u32).range(1..))]
    pub patience: u32,
}

/// The `number`-th, from 1, of `of` parts.
#[derive(Clone, Copy, Debug)]
pub struct Shard {
    pub number: usize,
    pub of: usize,
}

fn read_shard(text: &str) -> Result<Shard, String> {
    let numbers = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
    match numbers {
        Some((number, of)) if (1..=of).contains(&number) => Ok(Shard { number, of }),
        _ => Err("expected I/N with I from 1 to N".to_string()),
    }
}

#[derive(clap::Args)]
pub struct CellList {
    pub file: PathBuf,
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub set: Vec<String>,
    /// Frames of the camera path, as for run
    #[arg(long, value_name = "N")]
    pub frames: Option<u32>,
    /// Only cells that have no record in this folder yet
    #[arg(long, value_name = "DIR")]
    pub left: Option<PathBuf>,
}

#[derive(clap::Args)]
pub struct Reporting {
    /// Folders that runs have left their results in
    #[arg(required = true, value_name = "DIR")]
    pub folders: Vec<PathBuf>,
    /// Folder for the report [default: the only folder]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// The chain that tables compare the others with [default: the first]
    #[arg(long, value_name = "CHAIN")]
    pub baseline: Option<String>,
    /// The error of the plot, as `lodlab schema` calls it
    #[arg(long, value_name = "FIGURE", default_value = "error_rms")]
    pub error: String,
    /// The cost of the plot: method_ms, frame_ms, triangles, ...
    #[arg(long, value_name = "FIGURE", default_value = "method_ms")]
    pub cost: String,
}

#[derive(clap::Args)]
pub struct Comparing {
    /// Results before a change
    pub before: PathBuf,
    /// And after it
    pub after: PathBuf,
    /// Ratios of times nearer to 1 than this are the same
    #[arg(long, value_name = "SHARE", default_value_t = 0.05)]
    pub resolution: f64,
    /// Exit status 1 if a cell takes, beyond doubt, more than so many times as long
    #[arg(long, value_name = "RATIO")]
    pub most_slower: Option<f64>,
    /// Exit status 1 if an error of a cell grows by more than this
    #[arg(long, value_name = "AMOUNT")]
    pub most_worse: Option<f64>,
}

#[derive(clap::Args)]
pub struct Hunting {
    /// Where the random numbers begin; the same seed tries the same
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Ends after so many frames
    #[arg(long, value_name = "N", default_value_t = 1000)]
    pub frames: usize,
    /// Ends after so much time
    #[arg(long, value_name = "SECONDS")]
    pub seconds: Option<u32>,
    /// Ends after so many broken promises
    #[arg(long, value_name = "N")]
    pub finds: Option<usize>,
    /// Tries that making a scene simpler may take
    #[arg(long, value_name = "N", default_value_t = 150)]
    pub tries: usize,
    /// Only chains with this stage
    #[arg(long, value_name = "STAGE")]
    pub stage: Option<String>,
    /// An elevation file to take pieces of, besides noise and shapes
    #[arg(long, value_name = "FILE")]
    pub dem: Vec<PathBuf>,
    /// The adapter whose name contains this
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// The folder for experiments that break a promise
    #[arg(long, value_name = "DIR", default_value = "out/hunt")]
    pub out: PathBuf,
}

#[derive(clap::Args)]
pub struct Inspect {
    /// The experiment
    pub file: Option<PathBuf>,
    /// Sets a parameter, as for run
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub set: Vec<String>,
    /// The adapter whose name contains this
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Makes a picture of the window instead of opening one
    #[arg(long, value_name = "OUT.png")]
    pub screenshot: Option<PathBuf>,
    /// The chain (or the cell, as tables call it) that is shown
    #[arg(long, value_name = "CHAIN")]
    pub chain: Option<String>,
    /// A buffer to see, as `--dump` names it, or truth, truth-distance, screen-error; each has a view of its own
    #[arg(long, value_name = "BUFFER[@STEP]")]
    pub buffer: Vec<String>,
    /// The step after which the buffers are seen
    #[arg(long, value_name = "STEP")]
    pub after: Option<String>,
    /// The frame of the path
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub frame: usize,
    /// How buffers are seen: image, levels, plot, table, figure, above, view, orbit
    #[arg(long, value_name = "NAME")]
    pub look: Option<String>,
    /// The level of a pyramid
    #[arg(long, value_name = "N")]
    pub level: Option<u32>,
    /// The lowest and the highest value that colours tell apart
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true, value_parser = read_range)]
    pub range: Option<(f32, f32)>,
    /// What the buffers are compared with: f64, truth
    #[arg(long, value_name = "WHAT")]
    pub against: Option<String>,
    /// A folder that a run has left, for the results pane
    #[arg(long, value_name = "DIR")]
    pub results: Option<PathBuf>,
    /// Width and height of the picture
    #[arg(long, value_name = "WxH", default_value = "1440x900", value_parser = read_size)]
    pub size: (u32, u32),
    /// Only the views, without the window around them
    #[arg(long)]
    pub only_views: bool,
}

fn read_size(text: &str) -> Result<(u32, u32), String> {
    let (width, height) = text.split_once('x').ok_or("expected WIDTHxHEIGHT")?;
    let side = |text: &str| match text.parse() {
        Ok(side) if (16..=8192).contains(&side) => Ok(side),
        _ => Err(format!("`{text}` is not a side of 16 to 8192 pixels")),
    };
    Ok((side(width)?, side(height)?))
}

fn read_range(text: &str) -> Result<(f32, f32), String> {
    let numbers =
        text.split_once(',').and_then(|(low, high)| Some((low.trim().parse().ok()?, high.trim().parse().ok()?)));
    numbers.ok_or_else(|| "expected LOW,HIGH".to_string())
}
