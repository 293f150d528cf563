// SPDX-License-Identifier: MIT OR Apache-2.0
//! FPCore 2.0, the format of the FPBench benchmarks (<https://fpbench.org/spec/fpcore-2.0.html>): straight-line kernels, and loops whose
//! conditions depend on constants only. A precondition becomes the ranges of the arguments, and assumptions about what relates them.

mod evaluate;
mod operations;
mod pre;
mod syntax;
mod truth;

pub use operations::TABLE;

use crate::Error;
use crate::graph::{Array, Function, Graph, Port, Rewrites};
use crate::sink::Names;
use evaluate::{Definitions, Reader};
use std::collections::HashMap;
use syntax::{Kind, Node, Tree};

/// Limit on the length of a file, in bytes.
pub const MAX_BYTES: usize = 4 << 20;
/// Limit on the depth to which expressions nest, calls of other cores included.
pub const MAX_DEPTH: usize = 400;
/// Limit on the expressions that are evaluated for a core, iterations of loops and calls included.
pub const MAX_STEPS: usize = 200_000;
/// Limit on the arguments of a core.
pub const MAX_ARGUMENTS: usize = 4096;

/// A core of a file.
pub struct Core {
    /// The core's `:name`, or the symbol by which other cores call it, or its place in the file.
    pub name: String,
    /// Line on which it begins, from 1.
    pub line: usize,
    /// The core as a function of one output, or the reason why it is none.
    pub function: Result<Function, Error>,
}

/// Parts of a core.
#[derive(Clone)]
struct Definition<'a, 't> {
    line: usize,
    symbol: Option<&'a str>,
    arguments: Vec<&'a str>,
    properties: Vec<(&'a str, Tree<'a, 't>)>,
    body: Tree<'a, 't>,
}

/// Reads the cores of a file.
///
/// # Errors
/// If the text is no list of cores, with the line. A core that has no meaning here carries its own error.
pub fn read(source: &str, rewrites: Rewrites) -> Result<Vec<Core>, Error> {
    if source.len() > MAX_BYTES {
        return Err(Error::plain(format!("the file is longer than {} MiB", MAX_BYTES >> 20)));
    }
    let nodes = syntax::parse(source)?;
    if nodes.is_empty() {
        return Err(Error::plain("the file has no `(FPCore (arguments) expression)`"));
    }
    let definitions: Vec<Result<Definition<'_, '_>, Error>> = nodes.iter().map(Definition::read).collect();
    let by_symbol: Definitions<'_, '_> = definitions
        .iter()
        .flatten()
        .filter_map(|definition| Some((definition.symbol?, definition.clone())))
        .collect();
    let core = |(number, definition): (usize, Result<Definition<'_, '_>, Error>)| {
        let unnamed = || format!("core {}", number + 1);
        match definition {
            Ok(definition) => {
                let name = definition.name().unwrap_or_else(unnamed);
                let function = definition.function(&name, &by_symbol, rewrites);
                Core { name, line: definition.line, function }
            }
            Err(error) => Core { name: unnamed(), line: error.line.unwrap_or(1), function: Err(error) },
        }
    };
    Ok(definitions.into_iter().enumerate().map(core).collect())
}

impl<'a, 't> Definition<'a, 't> {
    fn read(node: &'t Node<'a>) -> Result<Definition<'a, 't>, Error> {
        let tree = node.tree();
        let parts = tree.list().unwrap_or_default();
        let part = |place: usize| parts.get(place).map(Node::tree);
        if part(0).and_then(Tree::word) != Some("FPCore") {
            return Err(tree.error(format!("expected `(FPCore (arguments) expression)`; found `{tree}`")));
        }
        let symbol = part(1).and_then(Tree::word);
        let at = 1 + usize::from(symbol.is_some());
        let Some(arguments) = part(at).and_then(Tree::list) else {
            return Err(tree.error(format!("`{tree}` has no list of arguments, as in `(FPCore (x y) …)`")));
        };
        if arguments.len() > MAX_ARGUMENTS {
            return Err(tree.error(format!("more than {MAX_ARGUMENTS} arguments")));
        }
        let arguments = arguments.iter().map(|node| argument(node.tree())).collect::<Result<Vec<_>, _>>()?;
        for (place, name) in arguments.iter().enumerate() {
            if arguments[..place].contains(name) {
                return Err(tree.error(format!("two arguments are `{name}`: rename one")));
            }
        }
        let (properties, rest) = properties(&parts[at + 1..])?;
        let [body] = rest else {
            let count = rest.len();
            return Err(
                tree.error(format!("a core has one expression behind its properties; this one has {count}"))
            );
        };
        Ok(Definition { line: tree.line, symbol, arguments, properties, body: body.tree() })
    }

    fn property(&self, name: &str) -> Option<Tree<'a, 't>> {
        self.properties.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }

    fn name(&self) -> Option<String> {
        match self.property(":name").map(|tree| tree.kind) {
            Some(Kind::Text(text)) => Some(text.to_owned()),
            _ => self.symbol.map(str::to_owned),
        }
    }

    fn function(
        &self,
        name: &str,
        cores: &Definitions<'a, 't>,
        rewrites: Rewrites,
    ) -> Result<Function, Error> {
        let graph = Graph::new(rewrites);
        let mut names = Names::of_language();
        let mut inputs: Vec<Port> = Vec::new();
        for argument in &self.arguments {
            let own = names.unique(argument);
            let text = if own == *argument { String::new() } else { format!("`{argument}` of the file") };
            inputs.push(Port::new(own, text));
        }
        let mut notes = Vec::new();
        let mut unused = Vec::new();
        for (key, value) in &self.properties {
            match *key {
                ":name" | ":pre" => {}
                ":description" => match value.kind {
                    Kind::Text(text) => notes.push(text.to_owned()),
                    _ => return Err(value.error("`:description` is a text")),
                },
                ":precision" | ":round" => {}
                other if !unused.contains(&other) => unused.push(other),
                _ => {}
            }
        }
        let (result, ranges, assumptions) = {
            let mut reader = Reader::new(&graph, cores);
            // Without a precision, a core is written for binary64.
            match self.property(":precision") {
                Some(precision) => reader.precision(precision)?,
                None => reader.wide(),
            }
            if let Some(round) = self.property(":round") {
                reader.rounding(round)?;
            }
            let pre = match self.property(":pre") {
                Some(condition) => pre::read(&mut reader, condition, &self.arguments, &inputs)?,
                None => pre::Precondition::default(),
            };
            reader.bind_inputs(&self.arguments);
            let result = reader.number(self.body)?;
            notes.append(&mut reader.notes);
            notes.extend(pre.notes);
            (result.id(), pre.ranges, pre.assumptions)
        };
        if !unused.is_empty() {
            notes.push(format!("passed over: {}", unused.join(", ")));
        }
        for (input, range) in inputs.iter_mut().zip(ranges) {
            input.range = range;
        }
        let output = Port::new(names.unique("result"), String::new());
        let input_arrays = self
            .arguments
            .iter()
            .enumerate()
            .map(|(number, _)| Array::new(&inputs[number].name, number, &[]));
        let input_arrays = input_arrays.collect();
        let output_arrays = vec![Array::new(&output.name, 0, &[])];
        let title = format!("{name}, from FPCore");
        let function = Function::new(graph, inputs, vec![(output, result)]);
        Ok(Function { title, notes, input_arrays, output_arrays, assumptions, ..function })
    }
}

/// Name of an argument; `(! :precision binary32 x)` may state its precision.
fn argument<'a>(tree: Tree<'a, '_>) -> Result<&'a str, Error> {
    if let Some(name) = tree.word() {
        return if syntax::number(name).is_some() || name.starts_with(':') {
            Err(tree.error(format!("`{name}` cannot name an argument")))
        } else {
            Ok(name)
        };
    }
    let parts = tree.list().unwrap_or_default();
    match parts.first().and_then(|part| part.tree().word()) {
        Some("!") => {
            let (annotations, rest) = properties(&parts[1..])?;
            for (key, value) in annotations {
                evaluate::annotation(key, value)?;
            }
            match rest {
                [name] => argument(name.tree()),
                _ => Err(tree.error(format!("`{tree}` names no argument"))),
            }
        }
        Some(name) => {
            Err(tree.error(format!("`{name}` is a tensor: give each element an argument of its own")))
        }
        None => Err(tree.error(format!("`{tree}` names no argument"))),
    }
}

/// Properties with their values in a tree.
type Properties<'a, 't> = Vec<(&'a str, Tree<'a, 't>)>;

/// Properties at the beginning of a list, and the rest.
fn properties<'a, 't>(mut parts: &'t [Node<'a>]) -> Result<(Properties<'a, 't>, &'t [Node<'a>]), Error> {
    let mut properties = Vec::new();
    while let [first, rest @ ..] = parts {
        let Some(key) = first.tree().word().filter(|word| word.starts_with(':')) else { break };
        let [value, rest @ ..] = rest else {
            return Err(first.tree().error(format!("`{key}` has no value")));
        };
        properties.push((key, value.tree()));
        parts = rest;
    }
    Ok((properties, parts))
}

/// Names with their values, of the innermost scope last.
type Scope<'a, 'g> = HashMap<&'a str, Vec<truth::Value<'g>>>;
