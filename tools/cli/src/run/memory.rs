// SPDX-License-Identifier: MIT OR Apache-2.0
//! Words of data memory by name: array elements in the notation of the source, and words from a label on, with indices counted like
//! addresses. `takt debug` and `takt live` use the same names.

use crate::run::loaded_program::LoadedProgram;
use crate::terminal::options::suggest;
use crate::terminal::output::Failure;
use anyhow::Result;
use takt_asm::names::NamedArray;
use takt_isa::Type;
use takt_isa::program::{Space, Symbol};
use takt_isa::text::element_names;

/// A word of data memory.
#[derive(Clone, Debug)]
pub(crate) struct Word {
    /// Name: `P[2,3]` for an array, `table[3]` for a label.
    pub(crate) title: String,
    /// Type of the value; words after a label are binary32.
    pub(crate) ty: Type,
    /// Address in data memory.
    pub(crate) address: u32,
}

/// Words that a name denotes: all elements of an array, or one of them; all words from a label up to the next label, or one of them.
///
/// # Errors
/// If the name denotes no words.
pub(crate) fn words(loaded: &LoadedProgram, name: &str) -> Result<Vec<Word>> {
    let arrays = &loaded.names.arrays;
    let program = &loaded.program;
    let is_label = |symbol: &&Symbol| symbol.space == Space::Data;
    let mut labels: Vec<&Symbol> = program.symbols.iter().filter(is_label).collect();
    labels.sort_by_key(|label| label.address);
    let owner = name.split('[').next().unwrap_or(name);
    let all = if let Some(array) = arrays.iter().find(|array| array.name == owner) {
        elements(array)
    } else if let Some(label) = labels.iter().find(|label| label.name == owner) {
        let next = labels.iter().map(|other| other.address).find(|other| *other > label.address);
        let end = next.unwrap_or(program.data.len() as u32).max(label.address + 1);
        let word =
            |address| Word { title: format!("{owner}[{}]", address - label.address), ty: Type::F, address };
        (label.address..end).map(word).collect()
    } else {
        let names = arrays.iter().map(|array| &array.name).chain(labels.iter().map(|label| &label.name));
        let near = suggest(owner, names.map(String::as_str));
        return Err(
            Failure::Usage(format!("--memory: nothing in data memory is called `{owner}`{near}")).into()
        );
    };
    let squeezed = |text: &str| text.replace(' ', "");
    let is_wanted = |word: &Word| name == owner || word.title == squeezed(name);
    let found: Vec<Word> = all.iter().filter(|word| is_wanted(word)).cloned().collect();
    match (found.is_empty(), &all[..]) {
        (true, [first, .., last]) => Err(Failure::Usage(format!(
            "--memory: `{owner}` has no element `{name}`; there are `{}` to `{}`",
            first.title, last.title
        ))
        .into()),
        (true, _) => Err(Failure::Usage(format!("--memory: `{owner}` has no element `{name}`")).into()),
        _ => Ok(found),
    }
}

/// Elements of an array, in memory order.
fn elements(array: &NamedArray) -> Vec<Word> {
    let titles = element_names(&array.name, &array.sizes).into_iter();
    titles.zip(array.base..).map(|(title, address)| Word { title, ty: array.ty, address }).collect()
}
