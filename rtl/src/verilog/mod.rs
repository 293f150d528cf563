// SPDX-License-Identifier: MIT OR Apache-2.0
//! Syntax tree of a Verilog module (ports, nets, assignments, always blocks, instances), and its printer.
//!
//! A [`Module`] prints its items in the order in which they were added. [`Module::finish`] checks that every name is declared once, and
//! before its use. An [`Expr`] is built from [`Net`]s, which know their widths, with Rust's operators `&`, `|`, `^`, `!`.

mod expression;
mod print;

pub use expression::{
    Expr, Net, Offset, Select, any, binary, choose, concat, decimal, gated, hexadecimal, no, number, repeat,
    string, yes,
};

use std::collections::BTreeSet;
use thiserror::Error;

/// Reason why a module is not valid Verilog.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ModuleError {
    /// A name is used before its declaration, or never declared.
    #[error("module {module}: `{name}` is used before it is declared")]
    Undeclared {
        /// Name of the module.
        module: String,
        /// Name that is used.
        name: String,
    },
    /// A name is declared twice.
    #[error(
        "module {module}: `{name}` is declared twice: names of slots, banks and units must not make the name of something else"
    )]
    Twice {
        /// Name of the module.
        module: String,
        /// Name that is declared again.
        name: String,
    },
}

/// Direction of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Driven from outside the module.
    Input,
    /// Driven by an assignment or an instance.
    Output,
    /// Driven by an always block.
    OutputRegister,
}

/// Port of a module.
#[derive(Clone, Debug)]
pub struct Port {
    /// Direction, as seen from the module.
    pub direction: Direction,
    /// Name and width of the port.
    pub net: Net,
    /// Comment on lines of its own before the port.
    pub heading: Option<String>,
    /// Comment on the port's line.
    pub remark: Option<&'static str>,
}

impl Port {
    /// A port without comments.
    pub fn new(direction: Direction, net: Net) -> Port {
        Port { direction, net, heading: None, remark: None }
    }

    /// Adds a comment before the port.
    pub fn heading(self, text: impl Into<String>) -> Port {
        Port { heading: Some(text.into()), ..self }
    }

    /// Adds a comment on the port's line.
    pub fn remark(self, text: &'static str) -> Port {
        Port { remark: Some(text), ..self }
    }
}

/// Parameter of a module.
#[derive(Clone, Debug)]
pub(crate) struct Parameter {
    pub(crate) net: Net,
    /// Default of the parameter.
    pub(crate) value: Expr,
    /// Comment on lines of its own before the parameter.
    pub(crate) heading: String,
}

/// Keyword of a net's declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Wire,
    Reg,
}

/// Statement of an always block.
#[derive(Clone, Debug)]
pub(crate) enum Statement {
    /// Assignment: nonblocking in a clocked block, blocking in a combinational one.
    Set { left: Expr, right: Expr, remark: Option<&'static str> },
    /// Statements executed while a condition is 1.
    If { condition: Expr, body: Vec<Statement> },
    /// Case statement on `of`.
    Case { of: Expr, arms: Vec<Arm>, default: Vec<Statement> },
}

/// Arm of a case statement.
#[derive(Clone, Debug)]
pub(crate) struct Arm {
    pub(crate) value: Expr,
    pub(crate) body: Vec<Statement>,
    pub(crate) remark: &'static str,
}

/// Assignment of `right` to `left`.
pub(crate) fn set(left: impl Into<Expr>, right: impl Into<Expr>) -> Statement {
    Statement::Set { left: left.into(), right: right.into(), remark: None }
}

/// Statements under a condition.
pub(crate) fn when(condition: impl Into<Expr>, body: Vec<Statement>) -> Statement {
    Statement::If { condition: condition.into(), body }
}

impl Statement {
    /// Adds a comment on the assignment's line.
    pub(crate) fn remark(self, text: &'static str) -> Statement {
        match self {
            Statement::Set { left, right, .. } => Statement::Set { left, right, remark: Some(text) },
            other => other,
        }
    }

    fn nets<'a>(&'a self, see: &mut dyn FnMut(&'a Net)) {
        match self {
            Statement::Set { left, right, .. } => {
                left.nets(see);
                right.nets(see);
            }
            Statement::If { condition, body } => {
                condition.nets(see);
                body.iter().for_each(|statement| statement.nets(see));
            }
            Statement::Case { of, arms, default } => {
                of.nets(see);
                for arm in arms {
                    arm.value.nets(see);
                    arm.body.iter().for_each(|statement| statement.nets(see));
                }
                default.iter().for_each(|statement| statement.nets(see));
            }
        }
    }
}

/// Instance of another module.
#[derive(Clone, Debug)]
pub(crate) struct Instance {
    module: String,
    name: String,
    parameters: Vec<(&'static str, Expr)>,
    ports: Vec<(String, Expr)>,
}

impl Instance {
    pub(crate) fn new(module: impl Into<String>, name: impl Into<String>) -> Instance {
        Instance { module: module.into(), name: name.into(), parameters: Vec::new(), ports: Vec::new() }
    }

    pub(crate) fn parameter(mut self, name: &'static str, value: u32) -> Instance {
        self.parameters.push((name, number(value)));
        self
    }

    /// Passes on a parameter of this module.
    pub(crate) fn parameter_as(mut self, name: &'static str, value: &Net) -> Instance {
        self.parameters.push((name, value.into()));
        self
    }

    /// Sets a parameter to an expression.
    pub(crate) fn parameter_is(mut self, name: &'static str, value: Expr) -> Instance {
        self.parameters.push((name, value));
        self
    }

    pub(crate) fn port(mut self, name: impl Into<String>, value: impl Into<Expr>) -> Instance {
        self.ports.push((name.into(), value.into()));
        self
    }

    /// Leaves output ports of the instance open.
    pub(crate) fn open(mut self, names: impl IntoIterator<Item = impl Into<String>>) -> Instance {
        self.ports.extend(names.into_iter().map(|name| (name.into(), Expr::Literal(String::new()))));
        self
    }

    /// Connects ports to the nets of the same names.
    pub(crate) fn same(mut self, nets: impl IntoIterator<Item = Net>) -> Instance {
        self.ports.extend(nets.into_iter().map(|net| (net.name().to_owned(), net.into())));
        self
    }
}

/// Item of a module.
#[derive(Clone, Debug)]
enum Item {
    Blank,
    Comment(String),
    Parameter { net: Net, value: u32 },
    Nets { kind: Kind, nets: Vec<Net>, value: Option<Expr>, remark: Option<&'static str> },
    Assign { left: Expr, right: Expr },
    Always { clocked: bool, body: Vec<Statement> },
    Instance(Instance),
}

/// Module under construction, checked as it grows.
#[derive(Clone, Debug)]
pub(crate) struct Module {
    name: String,
    heading: Vec<String>,
    parameters: Vec<Parameter>,
    ports: Vec<Port>,
    items: Vec<Item>,
    declared: BTreeSet<String>,
    error: Option<ModuleError>,
}

/// Clock of every module.
pub(crate) const CLK: Net = Net::bit("clk");

impl Module {
    /// A module with its ports; `heading` becomes the comment at the head of the file.
    pub(crate) fn new(name: &str, heading: Vec<String>, ports: Vec<Port>) -> Module {
        let mut module = Module {
            name: name.to_owned(),
            heading,
            parameters: Vec::new(),
            ports: Vec::new(),
            items: Vec::new(),
            declared: BTreeSet::new(),
            error: None,
        };
        for port in &ports {
            module.declare(&port.net);
        }
        module.ports = ports;
        module
    }

    /// Adds a parameter to the module's interface.
    pub(crate) fn takes(&mut self, parameter: Parameter) {
        self.declare(&parameter.net);
        self.parameters.push(parameter);
    }

    fn declare(&mut self, net: &Net) {
        if !self.declared.insert(net.name().to_owned()) {
            let (module, name) = (self.name.clone(), net.name().to_owned());
            self.error.get_or_insert(ModuleError::Twice { module, name });
        }
    }

    fn uses(&mut self, net: &Net) {
        if !self.declared.contains(net.name()) {
            let (module, name) = (self.name.clone(), net.name().to_owned());
            self.error.get_or_insert(ModuleError::Undeclared { module, name });
        }
    }

    fn check(&mut self, item: &Item) {
        let mut used: Vec<Net> = Vec::new();
        let mut see = |net: &Net| used.push(net.clone());
        match item {
            Item::Blank | Item::Comment(_) | Item::Parameter { .. } => {}
            Item::Nets { value, .. } => value.iter().for_each(|value| value.nets(&mut see)),
            Item::Assign { left, right } => {
                left.nets(&mut see);
                right.nets(&mut see);
            }
            Item::Always { clocked, body } => {
                if *clocked {
                    see(&CLK);
                }
                body.iter().for_each(|statement| statement.nets(&mut see));
            }
            Item::Instance(instance) => {
                let values = instance.parameters.iter().map(|(_, value)| value);
                let values = values.chain(instance.ports.iter().map(|(_, value)| value));
                values.for_each(|value| value.nets(&mut see));
            }
        }
        used.iter().for_each(|net| self.uses(net));
        match item {
            Item::Parameter { net, .. } => self.declare(net),
            Item::Nets { nets, .. } => nets.iter().for_each(|net| self.declare(net)),
            Item::Instance(instance) => self.declare(&Net::named(instance.name.clone())),
            _ => {}
        }
    }

    fn add(&mut self, item: Item) {
        self.check(&item);
        self.items.push(item);
    }

    pub(crate) fn blank(&mut self) {
        self.add(Item::Blank);
    }

    /// Adds lines of comment.
    pub(crate) fn comment(&mut self, text: impl Into<String>) {
        self.add(Item::Comment(text.into()));
    }

    /// Begins a section of the file.
    pub(crate) fn banner(&mut self, text: &str) {
        self.blank();
        self.comment(format!("---- {text}"));
    }

    /// Adds a `localparam` with a number.
    pub(crate) fn parameter(&mut self, net: Net, value: u32) {
        self.add(Item::Parameter { net, value });
    }

    fn nets(&mut self, kind: Kind, nets: impl IntoIterator<Item = Net>) {
        let nets: Vec<Net> = nets.into_iter().collect();
        // A declaration has one range, so nets of equal ranges share one.
        for same in nets.chunk_by(|a, b| a.range_text() == b.range_text()) {
            self.add(Item::Nets { kind, nets: same.to_vec(), value: None, remark: None });
        }
    }

    pub(crate) fn wires(&mut self, nets: impl IntoIterator<Item = Net>) {
        self.nets(Kind::Wire, nets);
    }

    pub(crate) fn regs(&mut self, nets: impl IntoIterator<Item = Net>) {
        self.nets(Kind::Reg, nets);
    }

    /// Adds a register with a comment on its line.
    pub(crate) fn reg(&mut self, net: Net, remark: &'static str) {
        self.add(Item::Nets { kind: Kind::Reg, nets: vec![net], value: None, remark: Some(remark) });
    }

    /// Declares a wire with its value.
    pub(crate) fn define(&mut self, net: Net, value: impl Into<Expr>) {
        self.add(Item::Nets { kind: Kind::Wire, nets: vec![net], value: Some(value.into()), remark: None });
    }

    /// Declares a net for an output that nothing takes, as wide as another net, with a name that linters pass over.
    pub(crate) fn discarded(&mut self, like: &Net) -> Net {
        let net = Net::named(format!("unused_{}", like.name())).wide(like.width());
        self.wires([net.clone()]);
        net
    }

    /// Marks bits of a net as possibly unused, for linters.
    pub(crate) fn unused(&mut self, net: Net, value: impl Into<Expr>, remark: Option<&'static str>) {
        let value = Some(concat([value.into(), no()]).every_bit());
        self.add(Item::Nets { kind: Kind::Wire, nets: vec![net], value, remark });
    }

    pub(crate) fn assign(&mut self, left: impl Into<Expr>, right: impl Into<Expr>) {
        self.add(Item::Assign { left: left.into(), right: right.into() });
    }

    /// Adds a clocked always block.
    pub(crate) fn clocked(&mut self, body: Vec<Statement>) {
        self.add(Item::Always { clocked: true, body });
    }

    /// Adds a combinational always block.
    pub(crate) fn combinational(&mut self, body: Vec<Statement>) {
        self.add(Item::Always { clocked: false, body });
    }

    pub(crate) fn instance(&mut self, instance: Instance) {
        self.add(Item::Instance(instance));
    }

    /// Text of the module.
    ///
    /// # Errors
    /// If a name is declared twice, or used before its declaration.
    pub(crate) fn finish(self) -> Result<String, ModuleError> {
        match self.error {
            Some(error) => Err(error),
            None => Ok(print::module(&self)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Net = Net::bit("a");
    const B: Net = Net::bus("b", 4);

    fn module() -> Module {
        Module::new("test", vec!["A test.".to_owned()], vec![Port::new(Direction::Input, CLK)])
    }

    #[test]
    fn names_are_declared_before_use() {
        let mut early = module();
        early.assign(A, no());
        early.wires([A]);
        let error = ModuleError::Undeclared { module: "test".to_owned(), name: "a".to_owned() };
        assert_eq!(early.finish(), Err(error.clone()));
        // Uses in every position are checked: in an index, a condition, a port.
        let uses: [&dyn Fn(&mut Module); 4] = [
            &|m| m.define(Net::bit("x"), B.at(A)),
            &|m| m.clocked(vec![when(A, vec![set(B, B)])]),
            &|m| m.instance(Instance::new("other", "x").port("in", Expr::from(B).any_bit() & A)),
            &|m| {
                m.clocked(vec![Statement::Case { of: B.into(), arms: Vec::new(), default: vec![set(B, A)] }])
            },
        ];
        for add in uses {
            let mut module = module();
            module.regs([B]);
            add(&mut module);
            assert_eq!(module.finish(), Err(error.clone()));
        }
    }

    #[test]
    fn names_are_declared_once() {
        let twice: [&dyn Fn(&mut Module); 4] = [
            &|m| m.wires([A, A]),
            &|m| m.wires([CLK]),
            &|m| m.instance(Instance::new("other", "clk")),
            &|m| m.parameter(CLK, 1),
        ];
        for add in twice {
            let mut module = module();
            add(&mut module);
            let error = module.finish().expect_err("twice");
            assert!(error.to_string().contains("is declared twice"), "{error}");
        }
    }

    #[test]
    fn operators_in_operators_have_parentheses() {
        let [x, y, z] = ["x", "y", "z"].map(Net::bit);
        let text = |expr: Expr| expr.to_string();
        assert_eq!(text(x.clone() & y.clone() & z.clone()), "x & y & z");
        assert_eq!(text((x.clone() & y.clone()) | z.clone()), "(x & y) | z");
        assert_eq!(text(!(x.clone() | y.clone()) & z.clone()), "~(x | y) & z");
        assert_eq!(text(x.clone() | Expr::from(B).any_bit()), "x | (|b)");
        assert_eq!(text(choose(x.clone(), y.clone() ^ z, B.slice(2, 1))), "x ? (y ^ z) : b[2:1]");
        assert_eq!(text(concat([Expr::from(x), repeat(3, y)])), "{{3{y}}, x}");
        assert_eq!(text(any([B.part(4, 2)])), "b[4 +: 2]");
        assert_eq!(text(any(Vec::<Expr>::new())), "1'b0");
        assert_eq!(text(binary(&[(1, 1), (3, 2)])), "4'b1_010");
        assert_eq!(text(hexadecimal(41, 0xfff)), "41'h00000000fff");
    }
}
