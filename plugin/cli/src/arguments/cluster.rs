//! Options of verbs whose work other processes and machines can do.

use crate::{arguments::revision, error::CliError};
use playbot_harness::game::Game;
use playbot_report::{counted, whole};
use playbot_train::{
    Experiment,
    cluster::{Address, Crew, CrewPlan, wire},
    trainer::ClusterReport,
};
use std::{
    env,
    ffi::OsString,
    path::PathBuf,
    process::{Command, Stdio},
};

/// Workers of a cluster.
#[derive(clap::Args, Clone, Debug)]
pub struct ClusterArgs {
    /// Let workers play: `processes` of this machine, or actors of Ray, on the cluster of this machine (`ray`) or on another
    /// one (ray://HOST:PORT). They change no result. Ray needs the Python package `playbot[ray]`.
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) cluster: Option<Address>,
    /// Number of workers (default: as many as there are processors).
    #[arg(long, value_name = "N", requires = "cluster", value_parser = clap::value_parser!(u32).range(1..=4096))]
    workers: Option<u32>,
    /// The program of the workers, where it lies on their machines (default: the path of this one).
    #[arg(long, value_name = "PATH", requires = "cluster")]
    worker_program: Option<PathBuf>,
}

impl ClusterArgs {
    fn program(&self) -> Result<PathBuf, CliError> {
        let own = || env::current_exe().map_err(|error| CliError::Io(format!("this program cannot be found: {error}")));
        self.worker_program.clone().map_or_else(own, Ok)
    }

    /// Starts the workers of a training, if any are asked for.
    ///
    /// # Errors
    ///
    /// They cannot be started.
    pub(crate) fn crew(&self, game: &dyn Game, experiment: &Experiment) -> Result<Option<Crew>, CliError> {
        let Some(address) = self.cluster.clone() else { return Ok(None) };
        let setup = wire::Setup {
            protocol: wire::PROTOCOL,
            code: code(),
            game_version: game.version(),
            experiment: experiment.to_ron().map_err(|error| CliError::Io(error.to_string()))?,
        };
        let workers = self.workers.map(|workers| workers as usize);
        let plan = CrewPlan { address, workers, program: self.program()?, python: python() };
        Ok(Some(Crew::open(plan, &setup)?))
    }

    /// Runs `verb` of the module `playbot.cluster` with these words behind the cluster's, and returns its exit code.
    ///
    /// # Errors
    ///
    /// The workers are not asked of Ray, or Python cannot be started.
    pub(crate) fn run_by_ray(&self, verb: &str, words: Vec<OsString>) -> Result<Option<i32>, CliError> {
        let address = match &self.cluster {
            None => return Ok(None),
            Some(Address::Ray(address)) => address.clone(),
            Some(Address::Processes) => {
                let words = "on one machine threads do it: use --threads, or name a cluster with --cluster ray";
                return Err(CliError::Usage(words.to_owned()));
            }
        };
        let mut command = Command::new(python());
        command.args(["-m", "playbot.cluster", verb, "--program"]).arg(self.program()?);
        command.args(address.iter().flat_map(|address| ["--address", address]));
        command.args(self.workers.iter().flat_map(|workers| ["--workers".to_owned(), workers.to_string()]));
        let status = command.args(words).stdin(Stdio::null()).status().map_err(|error| {
            let python = command.get_program().to_string_lossy().into_owned();
            CliError::Usage(format!(
                "`{python}` cannot be started ({error}): Ray is reached through Python; install `playbot[ray]`, and name it in \
                 PLAYBOT_PYTHON"
            ))
        })?;
        Ok(Some(status.code().unwrap_or(2)))
    }
}

/// Returns the version of the code that a training and its workers have in common.
pub(crate) fn code() -> String {
    format!("playbot {} ({})", env!("CARGO_PKG_VERSION"), revision())
}

/// Returns the Python that has the package `playbot`.
fn python() -> PathBuf {
    env::var_os("PLAYBOT_PYTHON").map_or_else(|| "python3".into(), PathBuf::from)
}

/// Reports what workers have done, and how long it took.
pub(crate) fn report_cluster(report: &ClusterReport) {
    let ClusterReport { workers, rollouts, traffic, played } = *report;
    let each = |bytes: u64| whole(bytes as f64 / rollouts.max(1) as f64 / 1000.0);
    let lost = match traffic.lost {
        0 => String::new(),
        1 => "; 1 worker was lost and replaced".to_owned(),
        lost => format!("; {lost} workers were lost and replaced"),
    };
    report!(
        "{} of {}: {} ms, {} kB of weights, {} kB of orders and {} kB of answers each{lost}",
        counted(rollouts, "rollout"),
        counted(workers as u64, "worker"),
        whole(played.as_secs_f64() * 1000.0 / rollouts.max(1) as f64),
        each(traffic.weights),
        each(traffic.orders),
        each(traffic.rollouts)
    );
}
