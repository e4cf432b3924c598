//! Comparison of exported ONNX graphs with what their policies give, under the engine tract.
//!
//! The argument is a folder of cases, `NAME.onnx` beside `NAME.safetensors` with `in.INPUT` and `out.OUTPUT`. The tests of
//! `playbot_onnx` write one for every kind of policy into the folder that `PLAYBOT_ONNX_CASES` names.

use safetensors::SafeTensors;
use std::{
    error::Error,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};
use tract_onnx::prelude::*;

/// Largest difference of an output, relative to numbers above 1.
const TOLERANCE: f32 = 1e-5;

fn main() -> ExitCode {
    let folder = std::env::args_os().nth(1).unwrap_or_default();
    match compared(Path::new(&folder)) {
        Ok(count) => {
            println!("{count} graphs give what their policies give");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Compares all cases of a folder, and returns their number.
fn compared(folder: &Path) -> Result<usize, Box<dyn Error>> {
    let entries = fs::read_dir(folder).map_err(|error| format!("name a folder of cases: {error}"))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "onnx"));
    files.sort();
    if files.is_empty() {
        return Err(format!("{} holds no graphs", folder.display()).into());
    }
    for file in &files {
        let largest = difference(file).map_err(|error| format!("{}: {error}", file.display()))?;
        println!("{largest:.1e} {}", file.display());
    }
    Ok(files.len())
}

/// Returns the largest difference of all outputs. Options that are taken must be equal.
fn difference(file: &Path) -> Result<f32, Box<dyn Error>> {
    let bytes = fs::read(file.with_extension("safetensors"))?;
    let case = SafeTensors::deserialize(&bytes)?;
    let numbers = |name: String| -> Result<(Vec<usize>, Vec<f32>), Box<dyn Error>> {
        let view = case.tensor(&name)?;
        let all = view.data().chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]]));
        Ok((view.shape().to_vec(), all.collect()))
    };
    let model = tract_onnx::onnx().model_for_path(file)?;
    let names = |outlets: &[OutletId]| -> Vec<String> {
        let name = |outlet: &OutletId| match model.outlet_label(*outlet) {
            Some(label) => label.to_owned(),
            None => model.node(outlet.node).name.clone(),
        };
        outlets.iter().map(name).collect()
    };
    let (inputs, outputs) = (names(model.input_outlets()?), names(model.output_outlets()?));
    let mut values = tvec![];
    for name in inputs {
        let (shape, all) = numbers(format!("in.{name}"))?;
        let single = Tensor::from_shape(&shape, &all)?;
        // Pictures are bytes.
        let value = if shape.len() == 4 { single.cast_to::<u8>()?.into_owned() } else { single };
        values.push(value.into_tvalue());
    }
    let plan = model.into_optimized()?.into_runnable()?;
    let mut largest = 0.0_f32;
    for (name, value) in outputs.iter().zip(plan.run(values)?) {
        let (shape, expected) = numbers(format!("out.{name}"))?;
        if value.shape() != shape {
            return Err(format!("`{name}` has the sizes {:?}, not {shape:?}", value.shape()).into());
        }
        let tolerance = if value.datum_type() == i64::datum_type() { 0.0 } else { TOLERANCE };
        let found = value.cast_to::<f32>()?;
        for (found, expected) in found.to_plain_array_view::<f32>()?.iter().zip(expected) {
            let difference = (found - expected).abs() / expected.abs().max(1.0);
            if difference.is_nan() || difference > tolerance {
                return Err(format!("`{name}` is {found} instead of {expected}").into());
            }
            largest = largest.max(difference);
        }
    }
    Ok(largest)
}
