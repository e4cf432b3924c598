//! Assets that Bevy's asset server is still loading, tasks that still run, and frames that wait for them.

use crate::carry_over::ReflectCarryResource;
use bevy::{
    app::{TaskPoolOptions, TaskPoolPlugin},
    asset::{AssetPath, handle_internal_asset_events, publish_asset_server_diagnostics},
    diagnostic::DiagnosticsStore,
    ecs::{
        schedule::{BoxedCondition, ConditionWithAccess, InternedSystemSet},
        system::BoxedSystem,
    },
    prelude::*,
    tasks::{AsyncComputeTaskPool, IoTaskPool, block_on, futures_lite::future::yield_now, poll_once},
};
use std::{
    fmt,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

/// Assets of a World that are not loaded, by their paths, each list in alphabetical order.
///
/// Its text names them: "still loading: `level.ron`; failed to load: `hero.png`".
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UnloadedAssets {
    /// Assets that are being loaded.
    pub loading: Vec<String>,
    /// Assets that stay unloaded, because a plugin has announced their loader and has not brought it. Bevy's loader of
    /// pictures comes with its renderer.
    pub without_loader: Vec<String>,
    /// Assets whose loading failed.
    pub failed: Vec<String>,
}

impl UnloadedAssets {
    /// Returns the assets of a World; nothing if it has no asset server.
    pub fn of(world: &World) -> Self {
        let Some(server) = world.get_resource::<AssetServer>() else { return Self::default() };
        let mut assets = Self::read(&format!("{server:?}"));
        assets.without_loader = assets.loading.extract_if(.., |path| !has_loader(server, path)).collect();
        assets
    }

    /// Returns whether every asset is loaded.
    pub fn is_empty(&self) -> bool {
        self.loading.is_empty() && self.without_loader.is_empty() && self.failed.is_empty()
    }

    /// Reads the description that the asset server gives of itself. No function of it lists its assets.
    fn read(text: &str) -> Self {
        let mut assets = Self::default();
        for asset in text.split("AssetInfo { ").skip(1) {
            let Some((before, state)) = asset.split_once(", load_state: ") else { continue };
            let path = before.split_once("path: Some(").and_then(|(_, path)| path.strip_suffix(')'));
            let path = path.unwrap_or("an asset without a path").to_owned();
            if state.starts_with("Loading") {
                assets.loading.push(path);
            } else if state.starts_with("Failed") {
                assets.failed.push(path);
            }
        }
        for paths in [&mut assets.loading, &mut assets.failed] {
            paths.sort();
            // The same file can be two assets, of two types.
            paths.dedup();
        }
        assets
    }
}

/// Returns whether the loader of a file is there, or is known not to exist.
fn has_loader(server: &AssetServer, path: &str) -> bool {
    let Ok(path) = AssetPath::try_parse(path) else { return true };
    // A loader that is only announced is waited for, however long that takes.
    block_on(poll_once(server.get_path_asset_loader(path))).is_some()
}

/// Paths that a message names.
const NAMED: usize = 8;

impl fmt::Display for UnloadedAssets {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lists = [
            ("still loading: ", &self.loading),
            ("without a loader in this build: ", &self.without_loader),
            ("failed to load: ", &self.failed),
        ];
        let mut separator = "";
        for (what, paths) in lists.into_iter().filter(|(_, paths)| !paths.is_empty()) {
            write!(formatter, "{separator}{what}")?;
            for (place, path) in paths.iter().take(NAMED).enumerate() {
                write!(formatter, "{}`{path}`", if place == 0 { "" } else { ", " })?;
            }
            if let Some(more) = paths.len().checked_sub(NAMED).filter(|more| *more > 0) {
                write!(formatter, " and {more} more")?;
            }
            separator = "; ";
        }
        Ok(())
    }
}

/// Looks, one a millisecond, in which no asset may arrive, and no task end, before the frames go on without them.
const PATIENT_LOOKS: u32 = 10_000;

/// The record of loads that frames have waited for.
#[derive(Resource, Default, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
struct AwaitedLoads {
    /// The system that counts loads.
    #[reflect(ignore)]
    count: Option<BoxedSystem>,
    /// Loads that had begun when the last wait was over.
    begun: Option<u64>,
}

/// Assets that did not arrive in time, which no frame waits for again.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource, CarryResource)]
struct OverdueAssets(Vec<String>);

/// Keeps Bevy from delivering loaded assets in the middle of a frame, where some machines are fast enough for the assets
/// of `Startup`, and others are not. [`wait_for_assets`] or [`deliver_assets`] delivers them after it. Call it before the
/// schedules run.
pub fn deliver_between_frames(world: &mut World) {
    let Some(mut schedules) = world.get_resource_mut::<Schedules>() else { return };
    let Some(schedule) = schedules.get_mut(PreUpdate) else { return };
    let delivery = set_of(handle_internal_asset_events);
    let systems = &mut schedule.graph_mut().systems;
    // Conditions are prepared with the systems that they belong to.
    if systems.is_initialized() {
        return;
    }
    let of_delivery = systems.iter().find(|(_, system, _)| system.default_system_sets().contains(&delivery));
    let key = of_delivery.map(|(key, ..)| key);
    if let Some(conditions) = key.and_then(|key| systems.get_conditions_mut(key)) {
        let never: BoxedCondition = Box::new(IntoSystem::into_system(|| false));
        conditions.push(ConditionWithAccess::new(never));
    }
}

/// Returns the set of a system, or a set itself.
fn set_of<M>(system: impl IntoSystemSet<M>) -> InternedSystemSet {
    system.into_system_set().intern()
}

/// Waits until the asset server has loaded everything that the game has asked for, so that the next frame finds it on
/// every machine. No game time passes.
///
/// A World without new loads is left at once. An asset that does not arrive for ten seconds is left behind.
pub fn wait_for_assets(world: &mut World) {
    if !world.contains_resource::<AssetServer>() {
        return;
    }
    world.init_resource::<AwaitedLoads>();
    world.init_resource::<OverdueAssets>();
    // Assets that arrive late, and those that no load has announced.
    handle_internal_asset_events(world);
    world.resource_scope(|world, mut awaited: Mut<AwaitedLoads>| {
        let begun = count_loads(&mut awaited, world);
        if begun.is_none() || begun != awaited.begun {
            wait_for_arrivals(world);
            awaited.begun = count_loads(&mut awaited, world);
        }
    });
}

/// Delivers the assets that have arrived, and waits for no other. It is for a person who plays without a recording: the
/// assets arrive there as they do in the game itself.
pub fn deliver_assets(world: &mut World) {
    if world.contains_resource::<AssetServer>() {
        run_tasks();
        handle_internal_asset_events(world);
    }
}

/// Returns the number of loads that have begun; `None` if the game has switched off Bevy's diagnostic of it.
fn count_loads(awaited: &mut AwaitedLoads, world: &mut World) -> Option<u64> {
    if !world.contains_resource::<DiagnosticsStore>() {
        return None;
    }
    // Bevy counts in `PreUpdate`, before the game has asked for the assets of a frame.
    let count = awaited.count.get_or_insert_with(|| {
        let mut count: BoxedSystem = Box::new(IntoSystem::into_system(publish_asset_server_diagnostics));
        count.initialize(world);
        count
    });
    count.run((), world).ok()?;
    let loads = world.resource::<DiagnosticsStore>().get_measurement(&AssetServer::STARTED_LOAD_COUNT)?;
    Some(loads.value as u64)
}

fn wait_for_arrivals(world: &mut World) {
    let mut missing = Vec::new();
    let mut looks = 0;
    loop {
        run_tasks();
        handle_internal_asset_events(world);
        let mut loading = UnloadedAssets::of(world).loading;
        loading.retain(|path| !world.resource::<OverdueAssets>().0.contains(path));
        if loading.is_empty() {
            return;
        }
        looks = if loading == missing { looks + 1 } else { 0 };
        missing = loading;
        if looks >= PATIENT_LOOKS {
            let assets = UnloadedAssets { loading: missing, ..default() };
            tracing::warn!("no asset has arrived for ten seconds, and the game goes on without them; {assets}");
            world.resource_mut::<OverdueAssets>().0.extend(assets.loading);
            return;
        }
        #[allow(clippy::disallowed_methods, reason = "files arrive by the clock; no game time passes meanwhile")]
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// A mark of Worlds whose frames wait for the game's tasks: see [`wait_for_tasks`].
#[derive(Resource, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct TasksEndWithFrames;

/// Returns Bevy's pools of threads with these options, and one thread for tasks of `AsyncComputeTaskPool`. They then run
/// one after the other, in the order in which they are spawned. The pools belong to the program: its first World makes
/// them.
pub fn tasks_in_order(mut options: TaskPoolOptions) -> TaskPoolPlugin {
    (options.async_compute.min_threads, options.async_compute.max_threads) = (1, 1);
    TaskPoolPlugin { task_pool_options: options }
}

/// Waits until the tasks that were spawned in Bevy's `AsyncComputeTaskPool` have run, in a World with
/// [`TasksEndWithFrames`]. No game time passes.
///
/// A task has run when it has ended, or waits for something else than tasks of this pool: a file, a timer or a thread. A
/// task that takes more than ten seconds is left behind, with a warning.
pub fn wait_for_tasks(world: &World) {
    /// The waits of all Worlds, which share the pool.
    static WAITS: TaskWaits = TaskWaits::new();

    if !world.contains_resource::<TasksEndWithFrames>() {
        return;
    }
    let Some(pool) = AsyncComputeTaskPool::try_get() else { return };
    WAITS.wait(pool.thread_num(), PATIENT_LOOKS, |meeting| pool.spawn(meeting.attend()).detach());
}

/// Times that all threads of a pool meet in a wait. A task that is woken by another one, or spawned by it, has run when
/// they meet the next time.
const ROUNDS: usize = 16;

/// The meeting of a pool's threads, by a task in each of them.
///
/// A pool runs its tasks in the order of their queue, so a thread comes to a meeting behind all earlier tasks. Several
/// threads stay until the last one has come: until then it may run an earlier task.
struct Meeting {
    threads: usize,
    state: Mutex<MeetingState>,
    changed: Condvar,
}

#[derive(Default)]
struct MeetingState {
    /// Arrivals of all rounds.
    arrivals: usize,
    is_over: bool,
}

impl Meeting {
    /// Attends all rounds. Spawn it once for each thread.
    async fn attend(self: Arc<Self>) {
        for round in 1..=ROUNDS {
            if self.meet(round) {
                return;
            }
            // To the end of the queue.
            yield_now().await;
        }
    }

    /// Meets the other threads. Returns whether the meeting is over.
    fn meet(&self, round: usize) -> bool {
        let mut state = lock(&self.state);
        state.arrivals += 1;
        state.is_over |= state.arrivals == ROUNDS * self.threads;
        if state.is_over || self.threads > 1 {
            self.changed.notify_all();
        }
        let is_early = |state: &mut MeetingState| state.arrivals < round * self.threads && !state.is_over;
        self.changed.wait_while(state, is_early).unwrap_or_else(PoisonError::into_inner).is_over
    }

    /// Waits for a look, and returns whether the meeting is over.
    fn look(&self) -> bool {
        let wait = self.changed.wait_timeout_while(lock(&self.state), Duration::from_millis(1), |state| !state.is_over);
        wait.unwrap_or_else(PoisonError::into_inner).0.is_over
    }

    /// Ends the meeting before all threads have come.
    fn end(&self) {
        lock(&self.state).is_over = true;
        self.changed.notify_all();
    }
}

/// The waits for the tasks of one pool.
struct TaskWaits {
    /// Held by the only World that waits, where a pool has several threads: two meetings would wait for each other's.
    turn: Mutex<()>,
    /// Meetings that were held.
    met: AtomicU64,
    /// The meeting that a thread has missed, since a task did not end in time.
    missed: Mutex<Option<Arc<Meeting>>>,
}

impl TaskWaits {
    const fn new() -> Self {
        Self { turn: Mutex::new(()), met: AtomicU64::new(0), missed: Mutex::new(None) }
    }

    /// Waits until a pool with so many threads has run its tasks, but only for this many looks in which no wait of any
    /// World ends. `spawn` puts a task at the end of the pool's queue that attends a meeting.
    fn wait(&self, threads: usize, patience: u32, spawn: impl Fn(Arc<Meeting>)) {
        let _turn = (threads > 1).then(|| lock(&self.turn));
        let mut patience = patience;
        if let Some(missed) = &*lock(&self.missed) {
            // Its tasks still wait in the queue, behind the one that does not end.
            if Arc::strong_count(missed) > 1 {
                return;
            }
            // Other threads have run them, so it may not have ended yet.
            patience = if threads > 1 { 1 } else { patience };
        }
        let meeting = Arc::new(Meeting { threads, state: Mutex::default(), changed: Condvar::new() });
        for _ in 0..threads {
            spawn(meeting.clone());
        }
        let (mut met, mut looks) = (self.met.load(Ordering::Relaxed), 0);
        while looks < patience {
            run_tasks();
            if meeting.look() {
                self.met.fetch_add(1, Ordering::Relaxed);
                *lock(&self.missed) = None;
                return;
            }
            let before = std::mem::replace(&mut met, self.met.load(Ordering::Relaxed));
            looks = if met == before { looks + 1 } else { 0 };
        }
        meeting.end();
        if lock(&self.missed).replace(meeting).is_none() {
            tracing::warn!(
                "a task of `AsyncComputeTaskPool` has not ended for ten seconds, and the game goes on without it; no \
                 frame waits for tasks until it ends"
            );
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs tasks that belong to this thread: those of the program's main loop, and without Bevy's feature
/// `multi_threaded` all of them.
fn run_tasks() {
    if let Some(pool) = IoTaskPool::try_get() {
        pool.with_local_executor(|tasks| {
            // As many as Bevy runs in a frame. A task that never rests must not hold the game up.
            for _ in 0..100 {
                if !tasks.try_tick() {
                    break;
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use async_executor::Executor;
    use bevy::{
        asset::{
            AssetLoader, LoadContext,
            io::{AssetReader, AssetReaderError, AssetSourceBuilder, PathStream, Reader, VecReader},
        },
        image::ImageLoader,
        tasks::futures_lite,
    };
    use futures_lite::future::{block_on, pending};
    use std::{
        cell::Cell,
        future::poll_fn,
        path::Path,
        sync::mpsc,
        task::{Poll, Waker},
        thread,
    };

    #[derive(Asset, TypePath)]
    struct Tiles;

    #[derive(Default, TypePath)]
    struct TilesLoader;

    impl AssetLoader for TilesLoader {
        type Asset = Tiles;
        type Settings = ();
        type Error = std::io::Error;

        async fn load(
            &self,
            _reader: &mut dyn Reader,
            _settings: &(),
            _context: &mut LoadContext<'_>,
        ) -> Result<Tiles, std::io::Error> {
            Ok(Tiles)
        }

        fn extensions(&self) -> &[&str] {
            &["tiles"]
        }
    }

    /// Files that never arrive.
    struct Never;

    impl AssetReader for Never {
        async fn read<'a>(&'a self, _path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
            std::future::pending::<()>().await;
            Ok(VecReader::new(Vec::new()))
        }

        async fn read_meta<'a>(&'a self, _path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
            std::future::pending::<()>().await;
            Ok(VecReader::new(Vec::new()))
        }

        async fn read_directory<'a>(&'a self, path: &'a Path) -> Result<Box<PathStream>, AssetReaderError> {
            Err(AssetReaderError::NotFound(path.to_path_buf()))
        }

        async fn is_directory<'a>(&'a self, _path: &'a Path) -> Result<bool, AssetReaderError> {
            Ok(false)
        }
    }

    #[test]
    fn assets_that_load_and_assets_that_failed_are_named_by_their_paths() {
        let mut app = App::new();
        app.register_asset_source("never", AssetSourceBuilder::new(|| Box::new(Never)))
            .add_plugins((TaskPoolPlugin::default(), AssetPlugin::default()))
            .init_asset::<Tiles>()
            .init_asset_loader::<TilesLoader>()
            .init_asset::<Image>()
            .preregister_asset_loader::<ImageLoader>(&["png"]);
        assert!(UnloadedAssets::of(app.world()).is_empty(), "nothing is asked for");
        let server = app.world().resource::<AssetServer>().clone();
        let _slow: [Handle<Tiles>; 2] = ["never://b.tiles", "never://a.tiles"].map(|path| server.load(path));
        let _picture: Handle<Image> = server.load("never://hero.png");
        let _missing: Handle<Tiles> = server.load("no/such.tiles");
        let named = UnloadedAssets {
            loading: vec!["never://a.tiles".to_owned(), "never://b.tiles".to_owned()],
            without_loader: vec!["never://hero.png".to_owned()],
            failed: vec!["no/such.tiles".to_owned()],
        };
        while UnloadedAssets::of(app.world()).failed.is_empty() {
            run_tasks();
            handle_internal_asset_events(app.world_mut());
            std::thread::yield_now();
        }
        assert_eq!(UnloadedAssets::of(app.world()), named);
        let text = "still loading: `never://a.tiles`, `never://b.tiles`; without a loader in this build: \
                    `never://hero.png`; failed to load: `no/such.tiles`";
        assert_eq!(named.to_string(), text);
    }

    #[test]
    fn a_message_names_eight_assets_and_counts_the_others() {
        let loading = (0..11).map(|number| format!("{number:02}.png")).collect();
        let text = UnloadedAssets { loading, ..default() }.to_string();
        assert!(text.starts_with("still loading: `00.png`, `01.png`, "), "{text}");
        assert!(text.ends_with("`07.png` and 3 more"), "{text}");
        assert_eq!(UnloadedAssets::default().to_string(), "");
    }

    /// Loads a file and runs a frame as soon as its task is done. Returns whether the file is there in the frame, and
    /// after it.
    fn delivery(is_between_frames: bool) -> [bool; 2] {
        let mut app = App::new();
        app.add_plugins((TaskPoolPlugin::default(), AssetPlugin::default()));
        app.init_asset::<Tiles>().init_asset_loader::<TilesLoader>();
        if is_between_frames {
            deliver_between_frames(app.world_mut());
        }
        let server = app.world().resource::<AssetServer>().clone();
        // A file that is missing fails to load, and the failure is delivered in the same way.
        let missing: Handle<Tiles> = server.load("no/such.tiles");
        let is_there = || server.load_state(&missing).is_failed();
        let mut in_a_frame = false;
        for _ in 0..200 {
            run_tasks();
            #[allow(clippy::disallowed_methods, reason = "a file that is missing needs some time")]
            std::thread::sleep(Duration::from_millis(1));
            app.world_mut().run_schedule(PreUpdate);
            in_a_frame |= is_there();
        }
        wait_for_assets(app.world_mut());
        [in_a_frame, is_there()]
    }

    #[test]
    fn assets_are_delivered_between_frames_and_not_in_them() {
        assert_eq!(delivery(false), [true, true], "as Bevy does it");
        assert_eq!(delivery(true), [false, true]);
    }

    #[test]
    fn a_world_without_an_asset_server_has_no_assets_to_wait_for() {
        let mut world = World::new();
        wait_for_assets(&mut world);
        assert!(UnloadedAssets::of(&world).is_empty());
        assert!(!world.contains_resource::<AwaitedLoads>());
    }

    /// A pool as Bevy has it with its feature `multi_threaded`, without which this crate is tested. Its threads end with
    /// the program.
    struct Pool {
        executor: Arc<Executor<'static>>,
        threads: usize,
        waits: TaskWaits,
    }

    impl Pool {
        fn new(threads: usize) -> Self {
            let executor = Arc::new(Executor::new());
            for _ in 0..threads {
                let executor = executor.clone();
                thread::spawn(move || block_on(executor.run(pending::<()>())));
            }
            Self { executor, threads, waits: TaskWaits::new() }
        }

        /// Waits, and returns the number of tasks that attended a meeting.
        fn wait(&self, patience: u32) -> usize {
            let attendants = Cell::new(0);
            self.waits.wait(self.threads, patience, |meeting| {
                attendants.set(attendants.get() + 1);
                self.executor.spawn(meeting.attend()).detach();
            });
            attendants.get()
        }

        fn spawn(&self, task: impl Future<Output = ()> + Send + 'static) {
            self.executor.spawn(task).detach();
        }
    }

    /// Takes some time, which differs from number to number.
    fn work(number: usize) {
        #[allow(clippy::disallowed_methods, reason = "a task that computes for a while")]
        thread::sleep(Duration::from_millis([3, 0, 1, 7, 0, 2][number % 6]));
    }

    #[test]
    fn a_wait_ends_when_all_tasks_have_run() {
        for threads in [1, 4] {
            let pool = Pool::new(threads);
            let done = Arc::new(Mutex::new(Vec::new()));
            for frame in 0..8 {
                for task in 0..frame {
                    let done = done.clone();
                    pool.spawn(async move {
                        work(frame + task);
                        lock(&done).push(task);
                    });
                }
                // One that waits for something else, without end.
                pool.spawn(pending());
                assert_eq!(pool.wait(PATIENT_LOOKS), threads);
                let mut done = std::mem::take(&mut *lock(&done));
                if threads > 1 {
                    done.sort_unstable();
                }
                assert_eq!(done, (0..frame).collect::<Vec<_>>(), "{threads} threads");
            }
        }
    }

    #[test]
    fn a_wait_includes_tasks_that_wait_for_others_of_their_pool() {
        for threads in [1, 4] {
            let pool = Pool::new(threads);
            let ended = Arc::new(AtomicU64::new(0));
            for frame in 1..=5 {
                let (executor, counted) = (pool.executor.clone(), ended.clone());
                pool.spawn(async move {
                    for child in 0..5 {
                        yield_now().await;
                        executor.spawn(async move { work(child) }).await;
                    }
                    counted.fetch_add(1, Ordering::Relaxed);
                });
                pool.wait(PATIENT_LOOKS);
                assert_eq!(ended.load(Ordering::Relaxed), frame, "{threads} threads");
            }
        }
    }

    #[test]
    fn worlds_that_wait_at_the_same_time_do_not_wait_for_each_other_without_end() {
        for threads in [1, 3] {
            let pool = Pool::new(threads);
            thread::scope(|scope| {
                for world in 0..4 {
                    let pool = &pool;
                    scope.spawn(move || {
                        let ended = Arc::new(AtomicU64::new(0));
                        for frame in 1..=20 {
                            let counted = ended.clone();
                            pool.spawn(async move {
                                work(world + frame);
                                counted.fetch_add(1, Ordering::Relaxed);
                            });
                            pool.wait(PATIENT_LOOKS);
                            assert_eq!(ended.load(Ordering::Relaxed), frame as u64);
                        }
                    });
                }
            });
        }
    }

    #[test]
    fn a_task_that_does_not_end_is_left_behind_until_it_does() {
        for threads in [1, 3] {
            let pool = Pool::new(threads);
            let (end, ended) = mpsc::channel::<()>();
            pool.spawn(async move {
                let _ = ended.recv();
            });
            assert_eq!(pool.wait(20), threads);
            assert!(lock(&pool.waits.missed).is_some(), "it is noted");
            if threads == 1 {
                assert_eq!(pool.wait(PATIENT_LOOKS), 0, "the thread has not come yet");
            }
            drop(end);
            while lock(&pool.waits.missed).is_some() {
                pool.wait(PATIENT_LOOKS);
                thread::yield_now();
            }
            let done = Arc::new(AtomicU64::new(0));
            let counted = done.clone();
            pool.spawn(async move {
                work(3);
                counted.fetch_add(1, Ordering::Relaxed);
            });
            assert_eq!(pool.wait(PATIENT_LOOKS), threads);
            assert_eq!(done.load(Ordering::Relaxed), 1);
        }
    }

    #[test]
    fn only_worlds_with_the_mark_wait_for_tasks() {
        let mut app = App::new();
        app.add_plugins(tasks_in_order(TaskPoolOptions::default()));
        let woken = Arc::new(Mutex::new((false, None::<Waker>)));
        let seen = woken.clone();
        let task = AsyncComputeTaskPool::get().spawn(poll_fn(move |context| {
            let mut seen = lock(&seen);
            if seen.0 {
                return Poll::Ready(());
            }
            seen.1 = Some(context.waker().clone());
            Poll::Pending
        }));
        wait_for_tasks(app.world());
        let waker = {
            let mut woken = lock(&woken);
            woken.0 = true;
            woken.1.take().expect("the task has run")
        };
        waker.wake();
        wait_for_tasks(app.world());
        assert!(!task.is_finished(), "this program runs tasks between frames");
        app.insert_resource(TasksEndWithFrames);
        wait_for_tasks(app.world());
        assert!(task.is_finished());
    }

    #[test]
    fn one_thread_runs_tasks_in_order_and_other_options_stay() {
        let mut options = TaskPoolOptions::default();
        options.io.max_threads = 7;
        let options = tasks_in_order(options).task_pool_options;
        assert_eq!((options.async_compute.min_threads, options.async_compute.max_threads), (1, 1));
        assert_eq!(options.io.max_threads, 7);
    }
}
