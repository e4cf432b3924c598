//! Where the numbers are computed.

use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// The compute backends of this build, by the name used on the command line and in files.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// burn-flex on the CPU.
    #[default]
    Flex,
    /// burn-ndarray on the CPU.
    Ndarray,
}

impl DeviceKind {
    /// Every kind of this build.
    pub const ALL: [Self; 2] = [Self::Flex, Self::Ndarray];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flex => "flex",
            Self::Ndarray => "ndarray",
        }
    }

    /// The device for inference: operations on it record nothing.
    pub fn plain(self) -> Device {
        match self {
            Self::Flex => Device::flex(),
            #[expect(deprecated, reason = "kept as a second opinion on flex")]
            Self::Ndarray => Device::ndarray(),
        }
    }

    /// The device for training: operations on it can be differentiated.
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
#[error("unknown device `{name}`; this build has: {}", DeviceKind::ALL.map(DeviceKind::name).join(", "))]
pub struct UnknownDevice {
    /// The name that was asked for.
    pub name: String,
}

impl FromStr for DeviceKind {
    type Err = UnknownDevice;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| UnknownDevice { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip_and_unknown_ones_list_the_known() {
        for kind in DeviceKind::ALL {
            assert_eq!(kind.to_string().parse(), Ok(kind));
        }
        let error = "cuda".parse::<DeviceKind>().expect_err("not in this build");
        assert!(error.to_string().contains("flex, ndarray"));
    }
}
