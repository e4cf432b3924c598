//! `playbot completions`.

use crate::{
    error::{CliError, Outcome},
    output::print_or_write,
};
use clap::Command;
use clap_complete::Shell;
use std::path::PathBuf;

/// Print a script that completes verbs and options in a shell.
///
/// The script is for the name of this program. Load it at the start of the shell, and make it again after an update. There
/// are no man pages: --help of each verb has all that they would say.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot completions bash --out complete.bash   then: source complete.bash
  playbot completions zsh --out complete.zsh   then: source complete.zsh
  playbot completions powershell --out complete.ps1   then: . ./complete.ps1")]
pub struct Args {
    /// The shell.
    shell: Shell,
    /// File to write it to instead of standard output. It must not exist.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Writes the script for this command line.
pub(crate) fn run(args: &Args, command: Command) -> Result<Outcome, CliError> {
    print_or_write(script(args.shell, command).trim_end(), args.out.as_deref())?;
    Ok(Outcome::Pass)
}

fn script(shell: Shell, mut command: Command) -> String {
    let (name, mut bytes) = (command.get_name().to_owned(), Vec::new());
    clap_complete::generate(shell, &mut command, name, &mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Arg, ValueEnum};

    #[test]
    fn the_script_of_every_shell_has_the_verbs_and_options_of_the_program() {
        let verb = Command::new("test").arg(Arg::new("levels").long("levels"));
        for shell in Shell::value_variants() {
            let text = script(*shell, Command::new("jump").subcommand(verb.clone()));
            for word in ["jump", "test", "levels"] {
                assert!(text.contains(word), "{shell} has no {word}: {text}");
            }
        }
    }
}
