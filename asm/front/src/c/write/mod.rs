// SPDX-License-Identifier: MIT OR Apache-2.0
//! Writes the program: declarations, and statements with the line of C beside the first of each.

mod plan;
mod text;

use super::exec::Exec;
use super::ir::{Block, Id, Kind, Node, Place, Statement};
use super::live::Live;
use super::ports::{Port, Roles};
use super::value::Object;
use super::{Options, Translation};
use crate::Error;
use crate::sink::Head;
use plan::{Plan, plan};
use std::fmt::Write as _;
use text::{Speller, real};

/// Column of comments.
const COMMENT: usize = 56;
/// Limit on the operations of an unrolled loop's iteration.
const UNROLLED: usize = 200;
/// Most members of a structure in data memory that a comment lists.
const MEMBERS: usize = 100;
/// Longest line of such a comment, in characters.
const LINE: usize = 120;
/// Maximum length of a comment, in characters.
const COMMENT_LENGTH: usize = 72;

/// The program of a step whose ports and states are known.
pub(super) fn program(exec: &mut Exec<'_>, roles: Roles, options: &Options) -> Result<Translation, Error> {
    let block = std::mem::take(&mut exec.blocks[0]);
    let live = Live::of(&exec.nodes, &block, &[], &roles.fixed);
    let block = live.pruned(block);
    let mut names = roles.names.clone();
    let mut arrays = std::mem::take(&mut exec.nodes.arrays);
    for array in &mut arrays {
        array.name = names.unique(&array.name);
    }
    exec.nodes.arrays = arrays;
    let mut indices = std::mem::take(&mut exec.nodes.indices);
    for index in &mut indices {
        *index = names.unique(index);
    }
    exec.nodes.indices = indices;
    let plan = plan(&exec.nodes, &block, &roles.fixed, names);
    let mut writer = Writer {
        exec,
        speller: Speller { nodes: &exec.nodes, plan: &plan, library: Default::default() },
        text: String::new(),
        said: None,
        labels: 0,
        indent: 8,
        arrays: vec![false; exec.nodes.arrays.len()],
    };
    writer.block(&block)?;
    let (code, arrays) = (writer.text, writer.arrays);
    let library = writer.speller.library.take();
    let mut head = Head::default();
    let files: Vec<&str> = exec.units.iter().map(|unit| base_name(&unit.files[0])).collect();
    let init = options.init.as_ref().map(|init| format!(", begun by {init}")).unwrap_or_default();
    head.comment(&format!(
        "{} of {}{init}, by takt cc: a period is one call.",
        options.step,
        files.join(", ")
    ));
    for note in &roles.notes {
        head.comment(note);
    }
    head.blank();
    for file in library {
        head.include(file);
    }
    head.lines(".ports  latched\n");
    ports(&mut head, ".input ", &roles.inputs);
    ports(&mut head, ".output", &roles.outputs);
    for state in &roles.states {
        let (ty, value) = match state.kind {
            Kind::Float => ("", real(state.initial)),
            Kind::Int => (":int", (state.initial as i32).to_string()),
        };
        head.lines(&format!(".state  {}{ty}\n.preset {} = {value}\n", state.name, state.name));
    }
    let kept = exec.kept();
    for (index, (array, used)) in exec.nodes.arrays.iter().zip(arrays).enumerate() {
        if used {
            head.lines(&declared_array(array));
            if array.kind.is_none()
                && let Some(words) = members(exec, index, &array.name)
            {
                words.iter().for_each(|line| head.comment(line));
            }
        }
        match kept.get(&index) {
            Some((c, true)) if used => {
                head.lines(&format!("{:<32}; {c}\n", format!(".result {}", array.name)))
            }
            Some((c, false)) if used => head.comment(&format!(
                "{c}: more inputs than ports. The host writes the array {} into data memory.",
                array.name
            )),
            _ => {}
        }
    }
    let registers: Vec<String> = plan
        .registers
        .iter()
        .map(|(name, kind)| if *kind == Kind::Int { format!("{name}:int") } else { name.clone() })
        .collect();
    head.registers(&registers);
    head.blank();
    head.lines(".schedule on\n.once\n        wait    period\n");
    head.lines(&format!(".period\nperiod:\n{code}        wait    period\n"));
    Ok(Translation { text: head.into_text(), inputs: roles.inputs, outputs: roles.outputs })
}

fn base_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// Declares ports, each array once.
fn ports(head: &mut Head, directive: &str, ports: &[Port]) {
    let mut done: Vec<&str> = Vec::new();
    for port in ports {
        let (name, dims) = &port.declared;
        if done.contains(&name.as_str()) {
            continue;
        }
        done.push(name);
        let sizes: Vec<String> = dims.iter().map(ToString::to_string).collect();
        let sizes = if sizes.is_empty() { String::new() } else { format!("[{}]", sizes.join(",")) };
        let ty = if port.float { "" } else { ":int" };
        let mut line = format!("{directive} {name}{sizes}{ty}");
        if port.c != *name {
            line = format!("{line:<32}; {}", port.c);
        }
        head.lines(&format!("{}\n", line.trim_end()));
    }
}

/// Lines that say which words of an array hold which members: `1 gain, 2 to 9 hist`. `None` if it is no object with a word for each scalar, or
/// has too many.
fn members(exec: &Exec<'_>, array: usize, name: &str) -> Option<Vec<String>> {
    let held = |object: &Object| object.arrays.iter().find(|(_, held)| *held == array).map(|(part, _)| *part);
    let (object, part) = exec.objects.iter().find_map(|object| Some((object, held(object)?)))?;
    let is_whole = exec.nodes.arrays[array].words.len() == part.count;
    let mut runs: Vec<(usize, usize, &str)> = Vec::new();
    for (leaf, word) in object.leaves[part.range()].iter().zip(1..) {
        match runs.last_mut() {
            Some((_, last, name)) if *name == leaf.name => *last = word,
            _ => runs.push((word, word, &leaf.name)),
        }
    }
    let mut lines = vec![format!("Words of {name}:")];
    for &(first, last, member) in &runs {
        let words = if first == last { first.to_string() } else { format!("{first} to {last}") };
        let text = format!(" {words} {member},");
        match lines.last_mut() {
            Some(line) if line.len() + text.len() <= LINE => line.push_str(&text),
            _ => lines.push(format!("   {text}")),
        }
    }
    if let Some(line) = lines.last_mut() {
        line.pop();
        line.push('.');
    }
    (is_whole && (2..=MEMBERS).contains(&runs.len())).then_some(lines)
}

fn declared_array(array: &super::ir::Array) -> String {
    let ty = match array.kind {
        Some(Kind::Float) => "",
        Some(Kind::Int) => ":int",
        None => ":bits",
    };
    let mut line = format!(".array  {}[{}]{ty}", array.name, array.words.len());
    if array.words.iter().any(|word| *word != 0) {
        let values: Vec<String> = array
            .words
            .iter()
            .map(
                |word| if array.kind == Some(Kind::Float) { real(*word) } else { (*word as i32).to_string() },
            )
            .collect();
        let _ = write!(line, " = {}", values.join(", "));
    }
    line + "\n"
}

struct Writer<'a, 'u> {
    exec: &'a Exec<'u>,
    speller: Speller<'a>,
    text: String,
    /// File and line of the last comment.
    said: Option<(String, usize)>,
    labels: usize,
    indent: usize,
    /// Arrays that the program uses.
    arrays: Vec<bool>,
}

impl Writer<'_, '_> {
    fn plan(&self) -> &Plan {
        self.speller.plan
    }

    fn block(&mut self, block: &Block) -> Result<(), Error> {
        for (statement, place) in block {
            match statement {
                Statement::Def(id) => {
                    self.uses(*id);
                    if !self.plan().inlined[id.0 as usize] {
                        let name = self.plan().value(*id).unwrap_or("zero").to_owned();
                        let expression = self.speller.expression(*id);
                        self.line(&format!("{name} = {expression}"), *place);
                    }
                }
                Statement::Store { array, index, value } => {
                    self.arrays[*array] = true;
                    let (to, value) = (self.speller.element(*array, *index), self.speller.operand(*value));
                    self.line(&format!("{to} = {value}"), *place);
                }
                Statement::Set(pairs) => self.set(pairs, *place),
                Statement::If { condition, then, other } => self.branch(*condition, then, other, *place)?,
                Statement::For { index, first, last, step, body } => {
                    let by = if *step == 1 { String::new() } else { format!(" step {step}") };
                    let count = (last - first) / step + 1;
                    let by = by + &self.unrolled(body, count);
                    let name = self.speller.nodes.indices[*index].clone();
                    self.line(&format!(".for    {name}, {first}, {last}{by}"), *place);
                    self.block(body)?;
                    self.line(".endfor", *place);
                }
                Statement::Loop { bound, body, again } => {
                    self.labels += 1;
                    let label = format!("again{}", self.labels);
                    self.line(&format!(".loop_bound {bound}"), *place);
                    let _ = writeln!(self.text, "{label}:");
                    self.block(body)?;
                    let again = self.speller.operand(*again);
                    self.line(&format!("bnz     {again}, {label}"), *place);
                }
            }
        }
        Ok(())
    }

    /// The `unroll` of an innermost loop, so that its iterations overlap, within [`UNROLLED`] operations.
    fn unrolled(&self, body: &Block, count: i64) -> String {
        let work = body.iter().try_fold(0, |sum, (statement, _)| match statement {
            Statement::Def(id) => match self.speller.nodes.node(*id) {
                Node::Op(op, ..) => Some(sum + op.cost()),
                _ => Some(sum + 1),
            },
            Statement::Store { .. } => Some(sum + 1),
            Statement::Set(pairs) => Some(sum + pairs.len()),
            Statement::If { .. } | Statement::For { .. } | Statement::Loop { .. } => None,
        });
        let fits = |by: &i64| 2 * by <= count && work.is_some_and(|work| work * *by as usize <= UNROLLED);
        [8, 4, 2].iter().find(|by| fits(by)).map(|by| format!(" unroll {by}")).unwrap_or_default()
    }

    fn uses(&mut self, id: Id) {
        if let Node::Load(array, ..) = self.speller.nodes.node(id) {
            self.arrays[array] = true;
        }
    }

    fn branch(&mut self, condition: Id, then: &Block, other: &Block, place: Place) -> Result<(), Error> {
        self.labels += 1;
        let number = self.labels;
        let condition = self.speller.operand(condition);
        let (over, end) = (format!("else{number}"), format!("end{number}"));
        if then.is_empty() {
            self.line(&format!("bnz     {condition}, {end}"), place);
            self.block(other)?;
        } else {
            let target = if other.is_empty() { &end } else { &over };
            self.line(&format!("bz      {condition}, {target}"), place);
            self.block(then)?;
            if !other.is_empty() {
                self.line(&format!("jmp     {end}"), place);
                let _ = writeln!(self.text, "{over}:");
                self.block(other)?;
            }
        }
        let _ = writeln!(self.text, "{end}:");
        Ok(())
    }

    /// Writes variables all at once: one after another where none reads a variable overwritten before, otherwise in one equation.
    fn set(&mut self, pairs: &[(usize, Id)], place: Place) {
        let mut left: Vec<(String, String, Vec<String>)> = Vec::new();
        for (var, value) in pairs {
            let (name, text) = (self.plan().var(*var).to_owned(), self.speller.operand(*value));
            if name == text {
                continue;
            }
            let mut reads = Vec::new();
            self.speller.reads(*value, &mut reads);
            left.push((name, text, reads));
        }
        while !left.is_empty() {
            let free = (0..left.len()).find(|index| {
                let name = &left[*index].0;
                left.iter().enumerate().all(|(other, (_, _, reads))| other == *index || !reads.contains(name))
            });
            match free {
                Some(index) => {
                    let (name, text, _) = left.remove(index);
                    self.line(&format!("{name} = {text}"), place);
                }
                None => {
                    // Variables that read one another's old values stand in one equation, and no others: an equation's registers are limited.
                    let mut together = vec![left.remove(0)];
                    let reads = |a: &(String, String, Vec<String>), b: &(String, String, Vec<String>)| {
                        a.2.contains(&b.0) || b.2.contains(&a.0)
                    };
                    while let Some(index) =
                        left.iter().position(|pair| together.iter().any(|other| reads(pair, other)))
                    {
                        together.push(left.remove(index));
                    }
                    let names: Vec<&str> = together.iter().map(|(name, ..)| name.as_str()).collect();
                    let texts: Vec<&str> = together.iter().map(|(_, text, _)| text.as_str()).collect();
                    let line = format!("{} = {}", names.join(", "), texts.join(", "));
                    self.line(&line, place);
                }
            }
        }
    }

    /// Writes a line, with the line of C next to it if that differs from the last one.
    fn line(&mut self, code: &str, place: Place) {
        let mut line = format!("{:1$}{code}", "", self.indent);
        let unit = &self.exec.units[place.unit];
        let (file, number) = unit.line(place.offset);
        let now = (base_name(file).to_owned(), number);
        if self.said.as_ref() != Some(&now) {
            let text: String = unit.text_of(place.offset).chars().take(COMMENT_LENGTH).collect();
            let pad = COMMENT.saturating_sub(line.chars().count());
            let _ = write!(line, "{:pad$} ; {}:{number}: {text}", "", now.0);
            self.said = Some(now);
        }
        self.text.push_str(line.trim_end());
        self.text.push('\n');
    }
}
