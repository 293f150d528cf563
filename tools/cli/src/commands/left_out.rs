// SPDX-License-Identifier: MIT OR Apache-2.0
//! Commands left out of this build to halve its compile time. The help still lists them, with the feature that adds each.

use crate::terminal::output::Failure;
use anyhow::Result;

/// Error of a command whose feature is missing in this build.
pub(crate) fn left_out(feature: &str) -> Result<()> {
    let text = format!(
        "this build of takt has no feature `{feature}`: `cargo install --path tools/cli --all-features` installs takt with all of \
         them, `cargo run --release --features {feature} -- …` runs it with this one"
    );
    Err(Failure::Usage(text).into())
}

/// Replaces the module of a missing feature: accepts any arguments, and names the feature when run.
macro_rules! module {
    ($feature:literal, $module:ident, $($arguments:ident by $run:ident),+) => {
        #[cfg(not(feature = $feature))]
        pub(crate) mod $module {
            $(
            #[derive(clap::Args)]
            #[command(about = concat!("Not in this build of takt: it takes the feature `", $feature, "`"), disable_help_flag = true)]
            pub(crate) struct $arguments {
                #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
                _any: Vec<std::ffi::OsString>,
            }

            pub(crate) fn $run(_: &$arguments, _: bool, _: &mut crate::terminal::files::Out) -> anyhow::Result<()> {
                super::left_out($feature)
            }
            )+
        }
    };
}

module!("model", model, Model by run);
module!("model", cc, Cc by run);
module!("editor", lsp, Lsp by run);
module!("editor", dap, Dap by run);
module!("fmu", fmu, ToFmu by run);
module!("board", board, Boards by run);
module!("board", live, LoadBoard by load, Live by live);
module!("robot", robot, Robot by run);

#[cfg(test)]
mod tests {
    #[test]
    fn absent_commands_name_their_feature() {
        let error = super::left_out("model").expect_err("it is not there").to_string();
        assert!(error.contains("--all-features") && error.contains("--features model -- "), "{error}");
    }
}
