// SPDX-License-Identifier: MIT OR Apache-2.0
//! Printer of a Verilog module: lines of up to 120 columns where expressions allow it, with assignments and ports aligned.

use super::{Direction, Expr, Instance, Item, Kind, Module, Port, Statement};
use std::fmt::Write as _;
use takt_isa::text::visible;

/// Columns of a line.
const COLUMNS: usize = 120;

pub(super) fn module(module: &Module) -> String {
    let mut v = String::new();
    for line in &module.heading {
        comment(&mut v, "", line);
    }
    let _ = write!(v, "\nmodule {} ", module.name);
    if !module.parameters.is_empty() {
        v.push_str("#(\n");
        for (i, parameter) in module.parameters.iter().enumerate() {
            let comma = if i + 1 < module.parameters.len() { "," } else { "" };
            comment(&mut v, "    ", &parameter.heading);
            let _ = writeln!(v, "    parameter {} = {}{comma}", parameter.net, parameter.value);
        }
        v.push_str(") ");
    }
    v.push_str("(\n");
    ports(&mut v, &module.ports);
    v.push_str(");\n\n");
    let mut blank = true;
    for item in &module.items {
        // No two blank lines in a row.
        if !(blank && matches!(item, Item::Blank)) {
            write_item(&mut v, item);
        }
        blank = matches!(item, Item::Blank);
    }
    if !blank {
        v.push('\n');
    }
    v.push_str("endmodule\n");
    v
}

/// Writes a comment, wrapped; continuation lines are indented like the text of the first.
fn comment(v: &mut String, indent: &str, text: &str) {
    // Names of files and links come from outside and may contain control characters.
    let text = &*visible(text);
    let inner = &text[..text.len() - text.trim_start().len()];
    let mut line = format!("{indent}//");
    let mut words = text.split_whitespace().peekable();
    let mut fresh = true;
    while let Some(word) = words.next() {
        line.push_str(if fresh && !inner.is_empty() { inner } else { "" });
        line.push(' ');
        line.push_str(word);
        fresh = false;
        if words.peek().is_some_and(|next| line.len() + 1 + next.len() > COLUMNS) {
            let _ = writeln!(v, "{line}");
            line = format!("{indent}//");
            fresh = true;
        }
    }
    let _ = writeln!(v, "{line}");
}

fn ports(v: &mut String, ports: &[Port]) {
    let wide = ports.iter().map(|port| port.net.range_text().len()).max().unwrap_or(0);
    let direction = |port: &Port| match port.direction {
        Direction::Input => "input  wire",
        Direction::Output => "output wire",
        Direction::OutputRegister => "output reg ",
    };
    let text = |port: &Port| format!("    {} {:<wide$}{}", direction(port), port.net.range_text(), port.net);
    let column = ports.iter().map(|port| text(port).len()).max().unwrap_or(0) + 3;
    for (i, port) in ports.iter().enumerate() {
        if let Some(heading) = &port.heading {
            comment(v, "    ", heading);
        }
        let comma = if i + 1 < ports.len() { "," } else { "" };
        let text = format!("{}{comma}", text(port));
        let _ = match port.remark {
            Some(remark) => writeln!(v, "{text:<column$}// {remark}"),
            None => writeln!(v, "{text}"),
        };
    }
}

fn write_item(v: &mut String, item: &Item) {
    let _ = match item {
        Item::Blank => writeln!(v),
        Item::Comment(text) => {
            comment(v, "    ", text);
            Ok(())
        }
        Item::Parameter { net, value } => writeln!(v, "    localparam {net} = {value};"),
        Item::Nets { kind, nets, value, remark } => {
            let kind = match kind {
                Kind::Wire => "wire",
                Kind::Reg => "reg",
            };
            let range = nets.first().map_or_else(String::new, super::Net::range_text);
            let head = format!("    {kind} {range}");
            let mut names = String::new();
            let mut column = head.len();
            for (i, net) in nets.iter().enumerate() {
                if i > 0 {
                    names.push(',');
                    let breaks = column + net.name().len() + 3 > COLUMNS;
                    names.push_str(if breaks { "\n        " } else { " " });
                    column = if breaks { 8 } else { column + 2 };
                }
                names.push_str(net.name());
                column += net.name().len();
            }
            let value = value.as_ref().map_or_else(String::new, |value| {
                format!(" = {}", value.broken(COLUMNS.saturating_sub(column + 4), "        "))
            });
            let remark = remark.map_or_else(String::new, |remark| format!("  // {remark}"));
            writeln!(v, "{head}{names}{value};{remark}")
        }
        Item::Assign { left, right } => {
            let head = format!("    assign {left} = ");
            writeln!(v, "{head}{};", right.broken(COLUMNS.saturating_sub(head.len() + 1), "        "))
        }
        Item::Always { clocked, body } => {
            let (head, operator) =
                if *clocked { ("    always @(posedge clk)", "<=") } else { ("    always @*", "=") };
            write_body(v, head, body, operator, 4);
            Ok(())
        }
        Item::Instance(instance) => {
            write_instance(v, instance);
            Ok(())
        }
    };
}

/// Writes `head` and its body: on the same line if the body is one assignment, otherwise between `begin` and `end`.
fn write_body(v: &mut String, head: &str, body: &[Statement], operator: &str, indent: usize) {
    match body {
        [Statement::Set { left, right, remark: None }]
            if head.len() + format!(" {left} {operator} {right};").len() <= COLUMNS =>
        {
            let _ = writeln!(v, "{head} {left} {operator} {right};");
        }
        [Statement::If { condition, body }] if body.len() == 1 => {
            write_body(v, &format!("{head} if ({condition})"), body, operator, indent);
        }
        _ => {
            let _ = writeln!(v, "{head} begin");
            write_statements(v, body, operator, indent + 4);
            let _ = writeln!(v, "{:indent$}end", "");
        }
    }
}

fn write_statements(v: &mut String, statements: &[Statement], operator: &str, indent: usize) {
    let is_set = |statement: &Statement| matches!(statement, Statement::Set { .. });
    let next = " ".repeat(indent + 4);
    for run in statements.chunk_by(|a, b| is_set(a) && is_set(b)) {
        let lefts = run.iter().filter_map(|statement| match statement {
            Statement::Set { left, .. } => Some(left.to_string().len()),
            _ => None,
        });
        let wide = lefts.max().unwrap_or(0);
        for statement in run {
            match statement {
                Statement::Set { left, right, remark } => {
                    let head = format!("{:indent$}{:<wide$} {operator} ", "", left.to_string());
                    let right = right.broken(COLUMNS.saturating_sub(head.len() + 1), &next);
                    let remark = remark.map_or_else(String::new, |remark| format!("  // {remark}"));
                    let _ = writeln!(v, "{head}{right};{remark}");
                }
                Statement::If { condition, body } => {
                    write_body(v, &format!("{:indent$}if ({condition})", ""), body, operator, indent);
                }
                Statement::Case { of, arms, default } => {
                    let _ = writeln!(v, "{:indent$}case ({of})", "");
                    let inline = |body: &[Statement]| {
                        body.iter()
                            .filter_map(|statement| match statement {
                                Statement::Set { left, right, .. } => {
                                    Some(format!("{left} {operator} {right};"))
                                }
                                _ => None,
                            })
                            .collect::<Vec<_>>()
                            .join(" ")
                    };
                    for arm in arms {
                        let body = inline(&arm.body);
                        let _ = writeln!(v, "{next}{}: begin {body} end  // {}", arm.value, arm.remark);
                    }
                    let _ = writeln!(v, "{next}default: {}", inline(default));
                    let _ = writeln!(v, "{:indent$}endcase", "");
                }
            }
        }
    }
}

/// Joins pieces with commas, in as few lines as possible.
fn fill(pieces: &[String], indent: &str) -> String {
    let mut text = String::new();
    let mut column = 0;
    for (i, piece) in pieces.iter().enumerate() {
        let comma = usize::from(i + 1 < pieces.len());
        let first = piece.split('\n').next().unwrap_or(piece);
        if i > 0 {
            let breaks = column + 1 + first.len() + comma > COLUMNS || piece.contains('\n');
            if breaks {
                let _ = write!(text, "\n{indent}");
                column = indent.len();
            } else {
                text.push(' ');
                column += 1;
            }
        } else {
            text.push_str(indent);
            column = indent.len();
        }
        text.push_str(piece);
        text.push_str(if comma > 0 { "," } else { "" });
        column = piece.rsplit_once('\n').map_or(column + piece.len(), |(_, last)| last.len()) + comma;
    }
    text
}

fn write_instance(v: &mut String, instance: &Instance) {
    let Instance { module, name, parameters, ports } = instance;
    let _ = write!(v, "    {module} ");
    if !parameters.is_empty() {
        let values: Vec<_> = parameters.iter().map(|(name, value)| format!(".{name}({value})")).collect();
        let line = values.join(", ");
        if module.len() + line.len() + name.len() + 13 <= COLUMNS {
            let _ = write!(v, "#({line}) ");
        } else {
            let _ = write!(v, "#(\n{}\n    ) ", fill(&values, "        "));
        }
    }
    let port = |(port, value): &(String, Expr)| {
        format!(".{port}({})", value.broken(COLUMNS.saturating_sub(port.len() + 13), "            "))
    };
    let ports: Vec<_> = ports.iter().map(port).collect();
    let _ = writeln!(v, "{name} (\n{}\n    );", fill(&ports, "        "));
}
