//! Options of verbs whose work other processes and machines can do.

use crate::{arguments::own_code, error::CliError};
use playbot_harness::game::Game;
use playbot_report::{counted, whole};
use playbot_train::{
    Experiment,
    cluster::{Address, Crew, CrewPlan, wire},
    trainer::ClusterReport,
};
use std::{env, ffi::OsString, path::PathBuf, process::Stdio};

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
    /// Returns the workers to start.
    fn plan(&self, address: Address) -> Result<CrewPlan, CliError> {
        let own = || env::current_exe().map_err(|error| CliError::Io(format!("this program cannot be found: {error}")));
        Ok(CrewPlan {
            address,
            workers: self.workers.map(|workers| workers as usize),
            program: self.worker_program.clone().map_or_else(own, Ok)?,
            python: env::var_os("PLAYBOT_PYTHON").map_or_else(|| "python3".into(), PathBuf::from),
        })
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
            code: own_code(),
            game_version: game.version(),
            experiment: experiment.to_ron().map_err(|error| CliError::Io(error.to_string()))?,
        };
        Ok(Some(Crew::open(self.plan(address)?, &setup)?))
    }

    /// Runs `verb` of the module `playbot.cluster` with these words behind the cluster's, and returns its exit code.
    ///
    /// # Errors
    ///
    /// The workers are not asked of Ray, or Python cannot be started.
    pub(crate) fn run_by_ray(&self, verb: &str, words: Vec<OsString>) -> Result<Option<i32>, CliError> {
        let address = match &self.cluster {
            None => return Ok(None),
            Some(address @ Address::Ray(_)) => address.clone(),
            Some(Address::Processes) => {
                let words = "on one machine threads do it: use --threads, or name a cluster with --cluster ray";
                return Err(CliError::Usage(words.to_owned()));
            }
        };
        let plan = self.plan(address)?;
        let mut command = plan.by_ray(verb);
        let status = command.args(words).stdin(Stdio::null()).status();
        let status = status.map_err(|error| CliError::Usage(plan.not_started(&command, error).to_string()))?;
        Ok(Some(status.code().unwrap_or(2)))
    }
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
