//! Compute devices: the CPU, or a graphics card in a build that supports it.

use crate::LearnError;
use burn::tensor::{Device, Element, Tensor, TensorData, kind::Basic};
use playbot_kernels::{among_workers::among_awake_workers, host_numbers::is_host};
use serde::{Deserialize, Serialize};
use std::{
    cell::{Cell, RefCell},
    fmt,
    panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook},
    str::FromStr,
    sync::Once,
};

/// The compute backends, by the name used on the command line and in files. The build decides which of them a program
/// has: [`DeviceKind::BUILT`].
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// burn-flex on the CPU, with this crate's own kernels.
    #[default]
    Flex,
    /// burn-ndarray on the CPU.
    Ndarray,
    /// A graphics card through Vulkan, Metal or DirectX 12; the feature `wgpu`.
    Wgpu,
    /// An NVIDIA card through CUDA; the feature `cuda`.
    Cuda,
}

impl DeviceKind {
    /// Every kind.
    pub const ALL: [Self; 4] = [Self::Flex, Self::Ndarray, Self::Wgpu, Self::Cuda];

    /// Kinds that compute on the CPU, which are in every build.
    pub const CPU: [Self; 2] = [Self::Flex, Self::Ndarray];

    /// Kinds of this build.
    pub const BUILT: &[Self] = &[
        Self::Flex,
        Self::Ndarray,
        #[cfg(feature = "wgpu")]
        Self::Wgpu,
        #[cfg(feature = "cuda")]
        Self::Cuda,
    ];

    /// Returns the name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flex => "flex",
            Self::Ndarray => "ndarray",
            Self::Wgpu => "wgpu",
            Self::Cuda => "cuda",
        }
    }

    /// Checks that it can compute: this build has it, and so has the machine. A graphics card is opened by the first
    /// call.
    ///
    /// # Errors
    /// [`LearnError::NoDevice`] names the missing part.
    pub fn check(self) -> Result<(), LearnError> {
        self.open().map_err(|reason| LearnError::NoDevice { device: self.to_string(), reason })
    }

    /// Returns the device for inference: operations on it record no graph.
    ///
    /// # Panics
    /// If this build does not have it; [`Self::check`] reports that before.
    pub fn plain(self) -> Device {
        match self {
            Self::Flex => Device::flex(),
            #[expect(deprecated, reason = "kept as a second opinion on flex")]
            Self::Ndarray => Device::ndarray(),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => Device::wgpu(burn::tensor::DeviceKind::DefaultDevice),
            #[cfg(feature = "cuda")]
            Self::Cuda => Device::cuda(0),
            #[cfg(not(all(feature = "wgpu", feature = "cuda")))]
            _ => panic!("{self} is not in this build"),
        }
    }

    /// Returns the device for training: operations on it can be differentiated.
    ///
    /// # Panics
    /// As [`Self::plain`].
    pub fn autodiff(self) -> Device {
        self.plain().autodiff()
    }

    /// Opens the device, once in a program.
    fn open(self) -> Result<(), String> {
        match self {
            Self::Flex | Self::Ndarray => Ok(()),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => once::wgpu(),
            #[cfg(feature = "cuda")]
            Self::Cuda => once::cuda(),
            #[cfg(not(all(feature = "wgpu", feature = "cuda")))]
            _ => Err(format!("this program was built without it; build it with `--features {self}`")),
        }
    }
}

#[cfg(any(feature = "wgpu", feature = "cuda"))]
mod once {
    use super::caught;
    use std::sync::OnceLock;

    type Opened = OnceLock<Result<(), String>>;

    #[cfg(feature = "wgpu")]
    pub(super) fn wgpu() -> Result<(), String> {
        static OPENED: Opened = OnceLock::new();
        let open = || match burn::tensor::Device::wgpu_options().init_with_setup() {
            Ok((_, setup)) => {
                let card = setup.adapter.get_info();
                tracing::info!("networks compute on {}, by {}", card.name, card.backend);
                Ok(())
            }
            Err(error) => Err(error.to_string()),
        };
        OPENED.get_or_init(|| caught(open).unwrap_or_else(Err)).clone()
    }

    #[cfg(feature = "cuda")]
    pub(super) fn cuda() -> Result<(), String> {
        use burn::tensor::{Device, Tensor};
        static OPENED: Opened = OnceLock::new();
        // CUDA itself is loaded by the first number.
        let open = || match Tensor::<1>::ones([1], &Device::cuda(0)).try_into_scalar::<f32>() {
            Ok(_) => Ok(()),
            Err(error) => Err(error.to_string()),
        };
        OPENED.get_or_init(|| caught(open).unwrap_or_else(Err)).clone()
    }
}

impl fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A device name that this build does not know.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum UnknownDevice {
    /// There is no such device.
    #[error("unknown device `{name}`; this build has: {}", built())]
    Name {
        /// The name that was asked for.
        name: String,
    },
    /// Only other builds have it.
    #[error("this program was built without `{kind}`; build it with `--features {kind}`, or take one of: {}", built())]
    NotBuilt {
        /// The kind.
        kind: DeviceKind,
    },
}

fn built() -> String {
    DeviceKind::BUILT.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ")
}

impl FromStr for DeviceKind {
    type Err = UnknownDevice;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match Self::ALL.into_iter().find(|kind| kind.name() == name) {
            None => Err(UnknownDevice::Name { name: name.to_owned() }),
            Some(kind) if !Self::BUILT.contains(&kind) => Err(UnknownDevice::NotBuilt { kind }),
            Some(kind) => Ok(kind),
        }
    }
}

// Guards that turn the failure of a graphics card into an error instead of a panic.

thread_local! {
    /// Number of guards that this thread is in.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
    /// Position of its last guarded panic.
    static PLACE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Runs `work`, and returns the message and position of a panic in this thread instead of printing it.
fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    listen();
    DEPTH.set(DEPTH.get() + 1);
    let result = catch_unwind(AssertUnwindSafe(work));
    DEPTH.set(DEPTH.get() - 1);
    result.map_err(|payload| {
        let words = payload.downcast_ref::<String>().map(String::as_str);
        let words = words.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no reason given");
        let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
        format!("{words} (at {})", PLACE.take())
    })
}

/// Installs a panic hook before the present one, once: otherwise guards of several threads would restore each other's
/// hooks.
fn listen() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info: &PanicHookInfo<'_>| {
            if DEPTH.get() == 0 {
                return before(info);
            }
            let place = info.location().map_or_else(|| "an unknown position".to_owned(), ToString::to_string);
            PLACE.replace(place);
        }));
    });
}

/// Bytes that learners have moved to graphics cards and back on the calling thread, which is the one that they compute on. The
/// arguments of kernels are not among them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes sent to cards.
    pub sent: u64,
    /// Bytes read from cards.
    pub read: u64,
}

thread_local! {
    static TRAFFIC: Cell<Traffic> = const { Cell::new(Traffic { sent: 0, read: 0 }) };
}

impl Traffic {
    /// Returns those since the thread began.
    pub fn so_far() -> Self {
        TRAFFIC.get()
    }

    fn count(data: &TensorData, device: &Device, way: fn(&mut Self) -> &mut u64) {
        if !is_host(device) {
            let mut all = TRAFFIC.get();
            *way(&mut all) += data.as_bytes().len() as u64;
            TRAFFIC.set(all);
        }
    }
}

/// Makes a tensor of data on `device`.
pub(crate) fn send<const D: usize, K: Basic>(data: TensorData, device: &Device) -> Tensor<D, K> {
    Traffic::count(&data, device, |all| &mut all.sent);
    Tensor::from_data(data, device)
}

/// Reads the data of a tensor as numbers of type `E`.
pub(crate) fn read<E: Element, const D: usize, K: Basic>(tensor: Tensor<D, K>) -> Result<TensorData, LearnError> {
    let device = tensor.device();
    let data = tensor.try_into_data_as::<E>().map_err(|e| LearnError::Device(e.to_string()))?;
    Traffic::count(&data, &device, |all| &mut all.read);
    Ok(data)
}

/// Runs `work` on `device`. A graphics card that is lost, or out of memory, is an error. Work in host memory is
/// unaffected.
pub(crate) fn guarded<T>(device: &Device, work: impl FnOnce() -> Result<T, LearnError>) -> Result<T, LearnError> {
    if is_host(device) {
        return work();
    }
    failures(work)
}

/// Runs the work of an update on `device`: in host memory among workers that wait awake, on a graphics card as
/// [`guarded`].
pub(crate) fn update_on<T: Send>(
    device: &Device,
    work: impl FnOnce() -> Result<T, LearnError> + Send,
) -> Result<T, LearnError> {
    if is_host(device) { among_awake_workers(work) } else { failures(work) }
}

/// Runs `work` as [`guarded`] does on a graphics card.
fn failures<T>(work: impl FnOnce() -> Result<T, LearnError>) -> Result<T, LearnError> {
    match caught(work) {
        Ok(Err(LearnError::Device(said))) => Err(LearnError::DeviceFailed { reason: first_cause(&said) }),
        Ok(result) => result,
        Err(reason) => Err(LearnError::DeviceFailed { reason }),
    }
}

/// Returns the first cause: a failing driver prints it last, after all errors that follow from it.
fn first_cause(said: &str) -> String {
    let is_filler = |line: &&str| {
        let fillers = ["Caused by:", "Asked at:", "No backtrace available", "skipped ", "("];
        line.is_empty() || fillers.iter().any(|filler| line.starts_with(filler))
    };
    said.lines().map(str::trim).rfind(|line| !is_filler(line)).unwrap_or("no reason given").to_owned()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn names_round_trip_and_unknown_ones_list_the_known() {
        for &kind in DeviceKind::BUILT {
            assert_eq!(kind.to_string().parse(), Ok(kind));
        }
        let error = "tpu".parse::<DeviceKind>().expect_err("unknown").to_string();
        assert!(error.contains("`tpu`") && error.contains("flex, ndarray"), "{error}");
    }

    #[test]
    fn what_other_builds_have_says_how_to_get_it() {
        for kind in DeviceKind::ALL.into_iter().filter(|kind| !DeviceKind::BUILT.contains(kind)) {
            let error = kind.name().parse::<DeviceKind>().expect_err("another build").to_string();
            assert!(error.contains(&format!("--features {kind}")) && error.contains("flex"), "{error}");
            let error = kind.check().expect_err("another build").to_string();
            assert!(error.contains(&format!("`{kind}`")) && error.contains("--features"), "{error}");
        }
    }

    #[test]
    fn panics_become_words() {
        assert_eq!(caught(|| 7), Ok(7));
        let said = |work: fn()| caught(work).expect_err("it panics");
        assert!(said(|| panic!("out of\n  memory")).starts_with("out of memory (at "));
        let here = said(|| panic!("{} left", 3));
        assert!(here.starts_with("3 left (at ") && here.contains("device.rs:"), "{here}");
    }

    #[test]
    fn whatever_a_card_does_is_one_kind_of_error() {
        let reason = |work: fn() -> Result<(), LearnError>| match failures(work) {
            Err(LearnError::DeviceFailed { reason }) => reason,
            other => panic!("{other:?}"),
        };
        assert!(reason(|| panic!("the device was lost")).starts_with("the device was lost"));
        assert_eq!(reason(|| Err(LearnError::Device("Caused by:\n  no memory".to_owned()))), "no memory");
        let other = failures::<()>(|| Err(LearnError::Config("too few".to_owned())));
        assert!(matches!(other, Err(LearnError::Config(_))), "an error of our own stays what it is");
    }

    #[test]
    fn guards_of_several_threads_leave_the_hook_alone() {
        static HEARD: AtomicUsize = AtomicUsize::new(0);
        listen();
        let before = take_hook();
        set_hook(Box::new(move |info: &PanicHookInfo<'_>| {
            HEARD.fetch_add(1, Ordering::Relaxed);
            before(info);
        }));
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| (0..50).for_each(|_| assert!(caught(|| panic!("here")).is_err())));
            }
        });
        let heard = HEARD.load(Ordering::Relaxed);
        assert!(catch_unwind(|| panic!("outside")).is_err());
        assert!(HEARD.load(Ordering::Relaxed) > heard, "earlier hooks still run");
    }

    #[test]
    fn the_source_of_an_error_is_reported() {
        let said = "An error happened\nCaused by:\n  An IO error happened\n  skipped `Kernel`: it failed\nCaused by:\n  \
                    can't allocate buffer of size: 268435456\nNo backtrace available\nAsked at:\nNo backtrace available";
        assert_eq!(first_cause(said), "can't allocate buffer of size: 268435456");
        assert_eq!(first_cause("no memory"), "no memory");
        assert_eq!(first_cause(""), "no reason given");
    }
}
