//! Training whose Worlds play in other processes, on this machine or others.
//!
//! A [`Crew`] is a number of workers. Before each rollout it gets the weights, and each worker an order to play a share of
//! the arenas; it answers with the share's rollout, and with the state of its arenas behind it. A share depends on the
//! weights, the levels and the states before it alone, and not on its worker. So a worker that is lost is replaced by one that
//! begins with these states, and a run has the same bytes with any number of workers as on one machine.
//!
//! There are two kinds of crews: processes of this machine, and a relay. A relay is one process that passes messages on to
//! workers elsewhere, such as `python -m playbot.cluster`, which starts them by Ray.
//!
//! The folder, in reading order:
//!
//! - [`wire`]: messages between a training and its workers.
//! - [`worker`]: a worker, which the verb `work` runs.
//!
//! ```
//! use playbot_train::cluster::Address;
//!
//! assert_eq!("processes".parse(), Ok(Address::Processes));
//! assert_eq!("ray".parse(), Ok(Address::Ray(None)));
//! assert_eq!("ray://head:10001".parse(), Ok(Address::Ray(Some("ray://head:10001".to_owned()))));
//! assert!("somewhere".parse::<Address>().is_err());
//! ```

pub mod wire;
pub mod worker;

use crate::cluster::wire::{Frame, Hello, Kind, Setup, read_frame, write_frame};
use playbot_learner::HasExitCode;
use std::{
    io::{self, BufReader, BufWriter},
    path::PathBuf,
    process::{Child, ChildStdin, Command, Stdio},
    str::FromStr,
    sync::{
        Arc,
        mpsc::{Receiver, Sender, channel},
    },
    thread,
};
use thiserror::Error;

/// The place of the workers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// Processes of this machine.
    Processes,
    /// Actors of Ray, on the cluster with this address; `None` for the one that this machine belongs to, or for workers of
    /// this machine if there is none.
    Ray(Option<String>),
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_port = |(host, port): (&str, &str)| !host.is_empty() && port.parse::<u16>().is_ok();
        match text {
            "processes" => Ok(Self::Processes),
            "ray" => Ok(Self::Ray(None)),
            _ if text.strip_prefix("ray://").unwrap_or(text).rsplit_once(':').is_some_and(is_port) => {
                Ok(Self::Ray(Some(text.to_owned())))
            }
            _ => Err("write `processes`, `ray`, `ray://HOST:PORT` or HOST:PORT".to_owned()),
        }
    }
}

/// Failure of a cluster.
#[derive(Debug, Error)]
pub enum ClusterError {
    /// A process of the crew cannot be started.
    #[error("`{program}` cannot be started: {source}; {advice}")]
    Start {
        /// Its program.
        program: String,
        /// The system's answer.
        source: io::Error,
        /// The remedy.
        advice: &'static str,
    },
    /// A worker was lost again and again.
    #[error(
        "worker {worker} was lost {times} times in a row, the last time because {why}; what was trained until the last \
         checkpoint is kept: go on with --resume"
    )]
    Lost {
        /// Number of the worker, from 0.
        worker: usize,
        /// Losses without a rollout between them.
        times: u32,
        /// The last one's reason.
        why: String,
    },
    /// The whole crew is gone.
    #[error("the cluster is lost: {0}; what was trained until the last checkpoint is kept: go on with --resume")]
    Gone(String),
    /// An answer that is none.
    #[error("worker {worker} gives no rollout: {why}")]
    Answer {
        /// Number of the worker, from 0.
        worker: usize,
        /// The difference to what was expected.
        why: String,
    },
    /// The policy cannot be sent.
    #[error("the policy cannot be sent to workers: {0}")]
    Weights(String),
    /// The training needs its Worlds here.
    #[error("a training against rivals plays on one machine: leave out --cluster")]
    Rivals,
}

impl HasExitCode for ClusterError {
    fn exit_code(&self) -> u8 {
        if matches!(self, Self::Rivals) { 3 } else { 2 }
    }
}

/// The workers to start.
#[derive(Clone, Debug)]
pub struct CrewPlan {
    /// Their place.
    pub address: Address,
    /// Their number; `None` for as many as there are processors.
    pub workers: Option<usize>,
    /// The program with the game and the verb `work`.
    pub program: PathBuf,
    /// The program that runs `-m playbot.cluster`, for Ray.
    pub python: PathBuf,
}

impl CrewPlan {
    /// Returns the call of a verb of `playbot.cluster`, with all that it needs to know of the workers.
    pub fn by_ray(&self, verb: &str) -> Command {
        let mut command = Command::new(&self.python);
        command.args(["-m", "playbot.cluster", verb, "--program"]).arg(&self.program);
        if let Address::Ray(Some(address)) = &self.address {
            command.args(["--address", address]);
        }
        command.args(self.workers.iter().flat_map(|workers| ["--workers".to_owned(), workers.to_string()]));
        command
    }

    /// Returns the error about a command that the system does not start.
    pub fn not_started(&self, command: &Command, source: io::Error) -> ClusterError {
        ClusterError::Start {
            program: command.get_program().to_string_lossy().into_owned(),
            source,
            advice: match self.address {
                Address::Processes => "the program of the workers is this one, unless --worker-program names another",
                Address::Ray(_) => {
                    "Ray is reached through Python: install `playbot[ray]`, and name it in PLAYBOT_PYTHON"
                }
            },
        }
    }
}

/// Bytes between a training and its workers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes of weights, once for each rollout.
    pub weights: u64,
    /// Bytes of orders to play.
    pub orders: u64,
    /// Bytes of rollouts.
    pub rollouts: u64,
    /// Workers that were lost and replaced.
    pub lost: u64,
}

/// Workers that play for a training. They end when it is dropped.
pub struct Crew {
    plan: CrewPlan,
    setup: Arc<Vec<u8>>,
    /// The newest weights, with their number.
    weights: Arc<Vec<u8>>,
    pipes: Vec<Pipe>,
    sender: Sender<Event>,
    events: Receiver<Event>,
    workers: usize,
    /// Processes started so far: each has a number, by which events of a process that is gone are known.
    started: u64,
    traffic: Traffic,
}

/// A process of a crew.
struct Pipe {
    number: u64,
    child: Child,
    input: Option<BufWriter<ChildStdin>>,
}

/// A message of a process, or its end.
struct Event {
    number: u64,
    frame: Option<Frame>,
}

/// An event in the life of a worker.
#[derive(Debug)]
pub(crate) enum Reply {
    /// It has played: the content of the message.
    Played(usize, Vec<u8>),
    /// It is lost, and another one has its number, which knows the weights.
    Lost(usize, String),
}

impl Crew {
    /// Starts the workers, for the training that `setup` describes.
    ///
    /// # Errors
    ///
    /// [`ClusterError`] if they cannot be started.
    pub fn open(plan: CrewPlan, setup: &Setup) -> Result<Self, ClusterError> {
        let (sender, events) = channel();
        // Texts and numbers are always JSON.
        let setup = Arc::new(serde_json::to_vec(setup).unwrap_or_default());
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let workers = plan.workers.unwrap_or(processors).max(1);
        let (weights, traffic) = (Arc::default(), Traffic::default());
        let mut crew = Self { plan, setup, weights, pipes: Vec::new(), sender, events, workers, started: 0, traffic };
        match crew.plan.address {
            Address::Processes => (0..workers).try_for_each(|_| crew.start().map(|pipe| crew.pipes.push(pipe)))?,
            Address::Ray(_) => {
                let relay = crew.start()?;
                crew.pipes.push(relay);
                crew.workers = crew.hello()?;
            }
        }
        let setup = crew.setup.clone();
        crew.send_all(Kind::Setup, &setup);
        Ok(crew)
    }

    /// Returns the number of workers.
    pub fn workers(&self) -> usize {
        self.workers
    }

    /// Returns the bytes so far.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    fn is_relayed(&self) -> bool {
        self.plan.address != Address::Processes
    }

    /// Starts a process, and a thread that reads from it.
    fn start(&mut self) -> Result<Pipe, ClusterError> {
        let mut command = match &self.plan.address {
            Address::Processes => Command::new(&self.plan.program),
            Address::Ray(_) => self.plan.by_ray("relay"),
        };
        if !self.is_relayed() {
            command.arg("work");
        }
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        // Ctrl-C is for the training, which then ends its workers.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|source| self.plan.not_started(&command, source))?;
        self.started += 1;
        let number = self.started;
        let (input, output, events) = (child.stdin.take(), child.stdout.take(), self.sender.clone());
        let read = move || {
            let mut output = output.map(BufReader::new);
            loop {
                let frame = output.as_mut().and_then(|output| read_frame(output).ok().flatten());
                let is_end = frame.is_none();
                if events.send(Event { number, frame }).is_err() || is_end {
                    return;
                }
            }
        };
        thread::Builder::new().name("worker's messages".to_owned()).spawn(read).map_err(|source| {
            ClusterError::Start { program: "a thread".to_owned(), source, advice: "take fewer workers" }
        })?;
        Ok(Pipe { number, child, input: input.map(BufWriter::new) })
    }

    /// Waits until the relay has its workers, and returns their number.
    fn hello(&mut self) -> Result<usize, ClusterError> {
        loop {
            match self.next_frame()? {
                (_, Some(Frame { kind: Kind::Hello, content, .. })) => {
                    let hello: Result<Hello, _> = serde_json::from_slice(&content);
                    let hello =
                        hello.map_err(|error| ClusterError::Gone(format!("no greeting of a relay: {error}")))?;
                    if hello.protocol != wire::PROTOCOL {
                        return Err(ClusterError::Gone(format!(
                            "its relay speaks version {} of the protocol, and this program version {}: install the Python \
                             package of the same version",
                            hello.protocol,
                            wire::PROTOCOL
                        )));
                    }
                    return Ok(hello.workers.max(1));
                }
                (_, Some(_)) => {}
                (_, None) => {
                    return Err(ClusterError::Gone(
                        "its relay ended before there were workers (what it said stands above); it is the module \
                         `playbot.cluster` of the Python package `playbot[ray]`"
                            .to_owned(),
                    ));
                }
            }
        }
    }

    /// Sends new weights to all workers.
    pub(crate) fn give_weights(&mut self, number: u64, bytes: &[u8]) {
        let mut content = Vec::with_capacity(bytes.len() + 8);
        content.extend(number.to_le_bytes());
        content.extend_from_slice(bytes);
        self.traffic.weights += content.len() as u64;
        self.weights = Arc::new(content);
        let weights = self.weights.clone();
        self.send_all(Kind::Weights, &weights);
    }

    /// Orders a worker to play.
    pub(crate) fn ask(&mut self, worker: usize, order: &[u8]) {
        self.traffic.orders += order.len() as u64;
        let pipe = if self.is_relayed() { 0 } else { worker };
        self.send(pipe, Kind::Play, worker as u32, order);
    }

    /// Waits for the next event.
    ///
    /// # Errors
    ///
    /// [`ClusterError`] if the crew is gone, or a worker cannot be replaced.
    pub(crate) fn next(&mut self) -> Result<Reply, ClusterError> {
        loop {
            let (number, frame) = self.next_frame()?;
            let Some(pipe) = self.pipes.iter().position(|pipe| pipe.number == number) else { continue };
            match frame {
                Some(Frame { kind: Kind::Played, worker, content }) => {
                    self.traffic.rollouts += content.len() as u64;
                    let worker = if self.is_relayed() { worker as usize } else { pipe };
                    return Ok(Reply::Played(worker, content));
                }
                Some(Frame { kind: Kind::Lost, worker, content }) => {
                    self.traffic.lost += 1;
                    return Ok(Reply::Lost(worker as usize, String::from_utf8_lossy(&content).into_owned()));
                }
                Some(_) => {}
                None if self.is_relayed() => {
                    return Err(ClusterError::Gone("its relay has ended (what it said stands above)".to_owned()));
                }
                None => {
                    let why = match self.pipes[pipe].child.wait() {
                        Ok(status) => format!("its process ended ({status})"),
                        Err(error) => format!("its process cannot be asked: {error}"),
                    };
                    self.replace(pipe)?;
                    return Ok(Reply::Lost(pipe, why));
                }
            }
        }
    }

    /// Starts another process in place of one that is gone.
    fn replace(&mut self, pipe: usize) -> Result<(), ClusterError> {
        self.traffic.lost += 1;
        self.pipes[pipe] = self.start()?;
        let (setup, weights) = (self.setup.clone(), self.weights.clone());
        self.send(pipe, Kind::Setup, pipe as u32, &setup);
        self.send(pipe, Kind::Weights, pipe as u32, &weights);
        Ok(())
    }

    /// Waits for a message of a process, or its end.
    fn next_frame(&mut self) -> Result<(u64, Option<Frame>), ClusterError> {
        // This side keeps a sender, too.
        let Ok(Event { number, frame }) = self.events.recv() else {
            return Err(ClusterError::Gone("nothing can be heard of it".to_owned()));
        };
        match frame {
            Some(Frame { kind: Kind::Failed, content, .. }) => {
                Err(ClusterError::Gone(String::from_utf8_lossy(&content).into_owned()))
            }
            frame => Ok((number, frame)),
        }
    }

    fn send_all(&mut self, kind: Kind, content: &[u8]) {
        (0..self.pipes.len()).for_each(|pipe| {
            let worker = if self.is_relayed() { wire::ALL } else { pipe as u32 };
            self.send(pipe, kind, worker, content);
        });
    }

    /// Sends a message. A process that cannot take it has ended, which its reader notices.
    fn send(&mut self, pipe: usize, kind: Kind, worker: u32, content: &[u8]) {
        let pipe = &mut self.pipes[pipe];
        let sent = pipe.input.as_mut().map(|input| write_frame(input, kind, worker, &[content]));
        if matches!(sent, Some(Err(_))) {
            pipe.input = None;
        }
    }
}

impl Drop for Crew {
    fn drop(&mut self) {
        // Processes end when nothing more can come.
        self.pipes.iter_mut().for_each(|pipe| pipe.input = None);
        for pipe in &mut self.pipes {
            // It may be gone already.
            let _ = pipe.child.wait();
        }
    }
}
