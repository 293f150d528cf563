// SPDX-License-Identifier: MIT OR Apache-2.0
//! The list of commands in `takt --help`, by what one wants to do.

use super::page::Page;
use clap::Command;
use textwrap::Options;

/// Headings, and the commands below each.
const GROUPS: [(&str, &[&str]); 7] = [
    ("Write a program", &["asm", "fmt", "cc", "model", "isa", "disasm"]),
    ("Run it, and look", &["run", "debug", "analyse", "eval"]),
    ("Know before it runs", &["bound", "accuracy", "verify"]),
    ("Put it on a circuit or a board", &["board", "load", "live", "cosim", "rtl"]),
    ("Choose or make a machine", &["machines", "explore"]),
    ("Drive the robots that come with Takt", &["track", "robot", "arm"]),
    (
        "Connect simulators, editors and shells",
        &["fmu", "editor", "lsp", "dap", "completions", "man", "help"],
    ),
];
/// Columns before a command's purpose.
const BESIDE: usize = 15;

/// Text of a command's purpose: the first line of its help.
fn purpose(command: &Command, name: &str) -> String {
    let about = command.find_subcommand(name).and_then(Command::get_about);
    about.map_or_else(|| "Print the help of a command".to_owned(), ToString::to_string)
}

/// Makes the list of commands one by groups.
pub(crate) fn grouped(command: Command, page: Page) -> Command {
    let indent = " ".repeat(BESIDE);
    let options = Options::new(page.columns()).subsequent_indent(&indent);
    let row = |name: &&str| {
        let beside = BESIDE - 2;
        textwrap::wrap(&format!("  {name:<beside$}{}", purpose(&command, name)), &options).join("\n")
    };
    let group = |(heading, names): &(&str, &[&str])| {
        format!("{heading}:\n{}\n", names.iter().map(row).collect::<Vec<_>>().join("\n"))
    };
    let list = GROUPS.iter().map(group).collect::<Vec<_>>().join("\n");
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{list}\nOptions:\n{{options}}{{after-help}}"
    );
    command.help_template(template)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn every_command_is_in_one_group() {
        let command = crate::Arguments::command();
        let mut listed: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        let shown = command.get_subcommands().filter(|one| !one.is_hide_set()).map(Command::get_name);
        let mut all: Vec<&str> = shown.chain(["help"]).collect();
        listed.sort_unstable();
        all.sort_unstable();
        assert_eq!(listed, all);
    }
}
