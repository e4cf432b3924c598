//! `playbot study --rewrite`: the tables of a study that is done, as this version of the program writes them.

use std::path::Path;

use playbot_lab::{
    report::StudyReport,
    train::{run_dir::write_atomically, sealed_file::read_sealed},
};

use super::error::CliError;

/// Writes `table.md` of a folder anew from its `results.json`, which holds the results of every run; learning curves are not
/// in there, so that `curves.svg` stays as it is.
///
/// # Errors
///
/// There are no results, or they are damaged.
pub fn rewrite(out: &Path) -> Result<(), CliError> {
    let path = out.join("results.json");
    if !path.exists() {
        let advice = "run the study, or name the folder of one that is done";
        return Err(CliError::Usage(format!("{}: there is no such file: {advice}", path.display())));
    }
    let (report, _) = read_sealed::<StudyReport>(&path)?;
    let table = report.to_markdown().map_err(|error| CliError::Usage(format!("{}: {error}", path.display())))?;
    write_atomically(&out.join("table.md"), table.as_bytes())?;
    tell!("written to {}: table.md, from its results.json", out.display());
    Ok(())
}
