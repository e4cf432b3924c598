//! Detection of a graphics card.

use super::DeviceKind;

impl DeviceKind {
    /// Opens the device, once in a program.
    pub(super) fn open(self) -> Result<(), String> {
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
    use crate::device::caught;
    use std::sync::OnceLock;

    type Opened = OnceLock<Result<(), String>>;

    #[cfg(feature = "wgpu")]
    pub(super) fn wgpu() -> Result<(), String> {
        static OPENED: Opened = OnceLock::new();
        let open = || match burn::tensor::Device::wgpu_options().init() {
            Ok(_) => Ok(()),
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
