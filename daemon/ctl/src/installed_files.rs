//! What is installed beside the programs and says the same as their `--help`: manual pages and shell
//! completions.

use std::io;
use std::path::{Path, PathBuf};

use clap::{Command, CommandFactory};
use clap_complete::Shell;

use crate::{Cli, Exit, Outcome};

/// The arguments.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Where they are written, in the places that they have below /usr/local/share.
    directory: PathBuf,
}

pub(crate) fn run(args: &Args) -> Outcome<Exit> {
    let failed = |error: io::Error| (Exit::CantCreate, format!("{}: {error}", args.directory.display()));
    let programs = [
        (shown(&Cli::command()), "man1"),
        (plant_sim::Args::command(), "man1"),
        (admittanced::Args::command(), "man8"),
        (admittance_egm::Args::command(), "man8"),
    ];
    for (mut program, section) in programs {
        manual(&program, section, &args.directory).map_err(failed)?;
        let name = program.get_name().to_owned();
        for (shell, place) in [
            (Shell::Bash, "bash-completion/completions"),
            (Shell::Zsh, "zsh/site-functions"),
            (Shell::Fish, "fish/vendor_completions.d"),
        ] {
            let place = args.directory.join(place);
            std::fs::create_dir_all(&place).map_err(failed)?;
            let written = clap_complete::generate_to(shell, &mut program, &name, &place).map_err(failed)?;
            if shell == Shell::Bash {
                // It is looked for by the program's name alone.
                std::fs::rename(written, place.join(&name)).map_err(failed)?;
            }
        }
    }
    Ok(Exit::Ok)
}

/// The program without its hidden subcommands.
fn shown(program: &Command) -> Command {
    let mut shown = Command::new("admittancectl")
        .subcommands(program.get_subcommands().filter(|subcommand| !subcommand.is_hide_set()).cloned());
    shown = shown.version(env!("CARGO_PKG_VERSION"));
    let texts = (program.get_about().cloned(), program.get_after_help().cloned());
    shown.about(texts.0.unwrap_or_default()).after_help(texts.1.unwrap_or_default())
}

/// A page for the program, and one for each of its subcommands.
fn manual(program: &Command, section: &str, directory: &Path) -> io::Result<()> {
    let place = directory.join("man").join(section);
    std::fs::create_dir_all(&place)?;
    let number = section.trim_start_matches("man");
    let page = |command: Command, name: &str| {
        let file = place.join(format!("{name}.{number}"));
        clap_mangen::Man::new(command)
            .section(number)
            .title(name.to_uppercase())
            .render(&mut std::fs::File::create(file)?)
    };
    let name = program.get_name().to_owned();
    for subcommand in program.get_subcommands() {
        let subcommand_name = format!("{name}-{}", subcommand.get_name());
        // What is read in the page's synopsis is what is typed.
        let typed = format!("{name} {}", subcommand.get_name());
        page(subcommand.clone().bin_name(typed).display_name(subcommand_name.clone()), &subcommand_name)?;
    }
    page(program.clone().disable_help_subcommand(true), &name)
}
