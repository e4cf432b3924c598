//! The compute backends by name.

use crate::LearnError;
use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

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

#[cfg(test)]
mod tests {
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
}
