// SPDX-License-Identifier: MIT OR Apache-2.0
//! Writes a controller as source: backward and forward pass as counted loops over the horizon, with each step's products unrolled and
//! products by zero left out.
//!
//! The macro `mpc_admm` of `<control.s>` computes the same for dense matrices and one symmetric bound. Here each state and input has limits
//! of its own, references enter the costs, and the last iteration, written separately, measures residuals.

use super::{Controller, References};
use crate::Error;
use crate::sink::{Arrays, Head, Period, machine_for, number};
use nalgebra::DMatrix;
use std::fmt::Write;
use takt_isa::Machine;

/// Source of a controller, and its interface.
pub struct Source {
    /// Text of the program.
    pub text: String,
    /// Machine with the memory sizes that the program needs.
    pub machine: &'static Machine,
    /// Data words of the arrays.
    pub words: usize,
    /// Arrays of input ports, with dimensions and meanings.
    pub inputs: Vec<(&'static str, Vec<usize>, &'static str)>,
    /// Arrays of output ports, with dimensions and meanings; without dimensions, a single port.
    pub outputs: Vec<(&'static str, Vec<usize>, &'static str)>,
}

/// Writes the source for a machine with a program memory of `bundles` bundles.
///
/// # Errors
/// If the machine has too few ports or too little memory, with the numbers.
pub fn source(controller: &Controller, machine: &'static Machine, bundles: usize) -> Result<Source, Error> {
    let system = &controller.system;
    let (n, m, steps) = (system.states(), system.inputs(), system.horizon);
    let mut inputs = vec![("x", vec![n], "state")];
    if system.relinearise > 0 {
        inputs.extend([
            ("A", vec![n, n], "matrix of the states' own dynamics"),
            ("B", vec![n, m], "matrix of the effect of the inputs"),
        ]);
    }
    match system.references {
        References::None => {}
        References::Constant => {
            inputs.extend([
                ("xr", vec![n], "reference of the state"),
                ("ur", vec![m], "reference of the input"),
            ]);
        }
        References::Horizon => inputs.extend([
            ("xr", vec![steps, n], "reference of the state in each step"),
            ("ur", vec![steps - 1, m], "reference of the input in each step"),
        ]),
    }
    let outputs = vec![
        ("u", vec![m], "input of the plant"),
        ("primal", vec![], "largest distance of the plan from its limits"),
        ("dual", vec![], "largest change in the last iteration, times rho"),
    ];
    let count = |ports: &[(&str, Vec<usize>, &str)]| -> usize {
        ports.iter().map(|(_, dims, _)| dims.iter().product::<usize>()).sum()
    };
    for (kind, found, most) in [
        ("input", count(&inputs), usize::from(machine.input_count())),
        ("output", count(&outputs), usize::from(machine.outputs_per_bank)),
    ] {
        if found > most {
            let remedy = match system.references {
                References::Horizon => "; references: `constant` takes fewer",
                _ if system.relinearise > 0 => "; without `relinearise` the matrices take none",
                _ => "",
            };
            return Err(Error::plain(format!(
                "it does not fit: {found} {kind} ports, {} has {most}{remedy}",
                machine.name
            )));
        }
    }
    let mut writer = Writer::new(controller);
    writer.body()?;
    let words = writer.arrays.words();
    let machine = machine_for(machine, bundles, words)?;
    let text = writer.text(machine, &inputs, &outputs)?;
    Ok(Source { text, machine, words, inputs, outputs })
}

/// Matrices whose products are unrolled, without products by zero.
struct Products {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    k: DMatrix<f64>,
    c: DMatrix<f64>,
    m: DMatrix<f64>,
}

struct Writer<'a> {
    controller: &'a Controller,
    products: Products,
    arrays: Arrays,
    code: String,
}

/// Stands for an entry known only at run time: neither 0 nor 1, so that its product is written out.
const UNKNOWN: f64 = 2.0;

/// Sum of the products of a row, such as `A[2,1]*e[1]`, without products by zero; `turned` reads a column instead.
fn row(name: &str, matrix: &DMatrix<f64>, i: usize, turned: bool, by: &str) -> Option<String> {
    let count = if turned { matrix.nrows() } else { matrix.ncols() };
    let entry = |j: usize| if turned { matrix[(j, i)] } else { matrix[(i, j)] };
    let at =
        |j: &str| if turned { format!("{name}[{j},{}]", i + 1) } else { format!("{name}[{},{j}]", i + 1) };
    let used: Vec<usize> = (0..count).filter(|j| entry(*j) != 0.0).collect();
    match used.len() {
        0 => None,
        _ if used.len() == count => Some(format!("sum(j, 1, {count}, {}*{by}[j])", at("j"))),
        _ => {
            let term = |j: &usize| match entry(*j) {
                1.0 => format!("{by}[{}]", j + 1),
                _ => format!("{}*{by}[{}]", at(&(j + 1).to_string()), j + 1),
            };
            Some(used.iter().map(term).collect::<Vec<_>>().join(" + "))
        }
    }
}

impl<'a> Writer<'a> {
    fn new(controller: &'a Controller) -> Writer<'a> {
        let Controller { system, factors } = controller;
        let of = |matrix: &DMatrix<f64>| match system.relinearise {
            0 => matrix.clone(),
            _ => matrix.map(|_| UNKNOWN),
        };
        let products = Products {
            a: of(&system.a),
            b: of(&system.b),
            k: of(&factors.k),
            c: of(&factors.c),
            m: of(&factors.m),
        };
        Writer { controller, products, arrays: Arrays::default(), code: String::new() }
    }

    fn text(
        &self,
        machine: &Machine,
        inputs: &[(&str, Vec<usize>, &str)],
        outputs: &[(&str, Vec<usize>, &str)],
    ) -> Result<String, Error> {
        let system = &self.controller.system;
        let (n, m) = (system.states(), system.inputs());
        let mut head = Head::default();
        head.comment(&format!(
            "{}: model-predictive control, {n} states, {m} inputs, a horizon of {}, {} iterations of ADMM with rho = {}",
            system.name, system.horizon, system.iterations, system.rho
        ));
        head.blank();
        head.machine(machine);
        for (name, dims, about) in inputs {
            head.input(name, dims, about);
        }
        for (name, dims, about) in outputs {
            head.output(name, dims, about);
        }
        head.latched();
        let fixed = system.relinearise == 0;
        if !fixed {
            head.include("control.s");
        }
        for (i, range) in system.x_range.iter().flatten().enumerate() {
            head.range(&format!("x[{}]", i + 1), *range)?;
        }
        head.blank();
        head.comment("Limits, and the matrices of both passes.");
        let limits = [("xl", n), ("xh", n), ("ul", m), ("uh", m)];
        let mut registers: Vec<String> =
            limits.iter().map(|(name, size)| format!("{name}[{size}]")).collect();
        registers.push(format!("K[{m},{n}]"));
        if fixed {
            registers.push(format!("B[{n},{m}]"));
        }
        head.registers(&registers);
        self.presets(&mut head, fixed)?;
        let vectors =
            [("_p", n), ("s", n), ("e", n), ("t", m), ("h", m), ("rx", n), ("cx", n), ("ru", m), ("cu", m)];
        let mut registers: Vec<String> =
            vectors.iter().map(|(name, size)| format!("{name}[{size}]")).collect();
        if system.references == References::Constant {
            registers.insert(3, format!("f[{n}]"));
        }
        registers.extend(["old", "total", "within", "over"].map(str::to_owned));
        if !fixed {
            registers.extend([format!("S[{m},{m}]"), format!("inverse[{m}]"), format!("w[{m}]")]);
            if m > 1 {
                registers.push(format!("L[{m},{m}]"));
            }
        }
        head.registers(&registers);
        let program = head.into_program(&Period { code: &self.code, contracted: true });
        Ok(format!("{program}\n; Factors, and what remains from period to period.\n{}", self.arrays.text()))
    }

    /// Presets the limits, and the constant matrices that are in registers.
    fn presets(&self, head: &mut Head, fixed: bool) -> Result<(), Error> {
        let system = &self.controller.system;
        let finite = |limit: f64| limit.clamp(f64::from(f32::MIN), f64::from(f32::MAX));
        for (limits, [lowest, highest]) in
            [(&system.x_limits, ["xl", "xh"]), (&system.u_limits, ["ul", "uh"])]
        {
            for (i, (low, high)) in limits.iter().enumerate() {
                head.preset(&format!("{lowest}[{}]", i + 1), finite(*low))?;
                head.preset(&format!("{highest}[{}]", i + 1), finite(*high))?;
            }
        }
        let matrices = [("B", &system.b), ("K", &self.controller.factors.k)];
        for (name, matrix) in matrices.into_iter().filter(|_| fixed) {
            for i in 0..matrix.nrows() {
                for j in 0..matrix.ncols() {
                    head.preset(&format!("{name}[{},{}]", i + 1, j + 1), matrix[(i, j)])?;
                }
            }
        }
        Ok(())
    }

    fn body(&mut self) -> Result<(), Error> {
        let Controller { system, factors } = self.controller;
        let (n, m, steps) = (system.states(), system.inputs(), system.horizon);
        let by_rows = |matrix: &DMatrix<f64>| matrix.transpose().as_slice().to_vec();
        if system.relinearise > 0 {
            self.factors()?;
        } else {
            for (name, matrix) in [("A", &system.a), ("M", &factors.m), ("C", &factors.c)] {
                self.arrays.values(name, &[matrix.nrows(), matrix.ncols()], &by_rows(matrix))?;
            }
        }
        for (name, dims) in [
            ("g", [steps, n]),
            ("y", [steps - 1, m]),
            ("q", [steps, n]),
            ("r", [steps - 1, m]),
            ("d", [steps - 1, m]),
        ] {
            self.arrays.zeros(name, &dims);
        }
        if system.references != References::None {
            self.arrays.zeros("xc", &[steps, n]);
            self.arrays.zeros("uc", &[steps - 1, m]);
            self.references()?;
        }
        if !system.warm_start {
            let _ = writeln!(
                self.code,
                ".for l, 1, {}\n.rep i, 1, {n}\n        g[l,i] = 0\n        q[l,i] = 0\n.endr\n.rep j, 1, {m}\n        y[l,j] = 0\n        r[l,j] = 0\n.endr\n.endfor\n.rep i, 1, {n}\n        g[{steps},i] = 0\n        q[{steps},i] = 0\n.endr",
                steps - 1
            );
        }
        if system.iterations > 1 {
            let _ = writeln!(self.code, ".for turn, 1, {} unroll 1", system.iterations - 1);
            self.iteration(false)?;
            self.code += ".endfor\n";
        }
        let _ = writeln!(
            self.code,
            "; The last iteration, with residuals.\n.rep i, 1, {n}\n        rx[i] = 0\n        cx[i] = 0\n.endr\n.rep j, 1, {m}\n        ru[j] = 0\n        cu[j] = 0\n.endr"
        );
        self.iteration(true)?;
        let largest = |x: &str, u: &str| {
            let all = (1..=n).map(|i| format!("{x}[{i}]")).chain((1..=m).map(|j| format!("{u}[{j}]")));
            let mut all: Vec<String> = all.collect();
            // Combines pairs, so that the chain has depth log₂ of the count.
            while all.len() > 1 {
                all = all
                    .chunks(2)
                    .map(|pair| match pair {
                        [a, b] => format!("max({a}, {b})"),
                        _ => pair[0].clone(),
                    })
                    .collect();
            }
            all.swap_remove(0)
        };
        let _ = writeln!(
            self.code,
            "        primal = {}\n        dual = {}",
            largest("rx", "ru"),
            largest("cx", "cu")
        );
        let _ = writeln!(self.code, ".rep j, 1, {m}\n        u[j] = d[1,j]\n.endr");
        Ok(())
    }

    /// Recomputes the factors from matrices that are inputs: steps of the Riccati recursion, starting from the last period's cost-to-go,
    /// and in the first period from that of the file's matrices.
    fn factors(&mut self) -> Result<(), Error> {
        let Controller { system, factors } = self.controller;
        let (n, m, rho) = (system.states(), system.inputs(), system.rho);
        let by_rows = |matrix: &DMatrix<f64>| matrix.transpose().as_slice().to_vec();
        let (q, r) = (&system.q + DMatrix::identity(n, n) * rho, &system.r + DMatrix::identity(m, m) * rho);
        for (name, matrix) in [("P", &factors.p), ("Qr", &q), ("Rr", &r)] {
            self.arrays.values(name, &[matrix.nrows(), matrix.ncols()], &by_rows(matrix))?;
        }
        for (name, dims) in [("M", [n, n]), ("C", [m, m]), ("Km", [m, n]), ("PB", [n, m])] {
            self.arrays.zeros(name, &dims);
        }
        // Each use of the macro has arrays of its own.
        self.arrays.reserve(system.relinearise.min(2) * 2 * n * (n + m));
        // All steps but the last change only P.
        let step = format!("        riccati_step P, Km, A, B, Qr, Rr, {n}, {m}\n");
        if system.relinearise > 1 {
            let _ = write!(self.code, ".for step, 1, {} unroll 1\n{step}.endfor\n", system.relinearise - 1);
        }
        // C = (Rr + Bᵀ·P·B)⁻¹ for the P from which the last step computes its gain, column by column from the factors of S.
        let _ = write!(
            self.code,
            "\
.for i, 1, {n}
.rep j, 1, {m}
        PB[i,j] = sum(k, 1, {n}, P[i,k]*B[k,j])
.endr
.endfor
.rep i, 1, {m}
.rep j, 1, i
        S[i,j] = Rr[i,j] + sum(k, 1, {n}, B[k,i]*PB[k,j])
.endr
.endr
        array_factors L, inverse, S, {m}
.rep j, 1, {m}
.rep i, j, {m}
        w[i] = (i == j ? 1.0 : 0.0) - sum(k, j, i - 1, L[i,k]*w[k])
.endr
.rep i, 1, {m}
        w[{m}+1-i] = ({m}+1-i >= j ? w[{m}+1-i]*inverse[{m}+1-i] : 0.0) - sum(k, {m}+2-i, {m}, L[k,{m}+1-i]*w[k])
        C[{m}+1-i,j] = w[{m}+1-i]
.endr
.endr
{step}\
.rep i, 1, {m}
.rep j, 1, {n}
        K[i,j] = Km[i,j]
.endr
.endr
.rep j, 1, {n}
.rep i, 1, {n}
        M[j,i] = A[i,j] - sum(k, 1, {m}, B[i,k]*K[k,j])
.endr
.endr
"
        );
        Ok(())
    }

    /// Linear costs of the references: -Q·xr, -R·ur, and for the last state -P·xr without the penalty.
    fn references(&mut self) -> Result<(), Error> {
        let Controller { system, factors } = self.controller;
        let steps = system.horizon;
        let terminal = factors.terminal(system.rho);
        let horizon = system.references == References::Horizon;
        let by_rows = |matrix: &DMatrix<f64>| (-matrix).transpose().as_slice().to_vec();
        let fixed = system.relinearise == 0;
        let constant = [("Qn", &system.q), ("Rn", &system.r), ("Pn", &terminal)];
        for (name, matrix) in constant.into_iter().filter(|(name, _)| fixed || *name != "Pn") {
            self.arrays.values(name, &[matrix.nrows(), matrix.ncols()], &by_rows(matrix))?;
        }
        for (cost, name, matrix, port, last) in
            [("xc", "Qn", &system.q, "xr", steps - 1), ("uc", "Rn", &system.r, "ur", steps - 1)]
        {
            for i in 0..matrix.nrows() {
                let product = |row_of: &str| {
                    let used = (0..matrix.ncols()).filter(|j| matrix[(i, *j)] != 0.0);
                    let terms: Vec<String> =
                        used.map(|j| format!("{name}[{},{}]*{row_of}{}]", i + 1, j + 1, j + 1)).collect();
                    if terms.is_empty() { "0".to_owned() } else { terms.join(" + ") }
                };
                if horizon {
                    for l in 1..=last {
                        let _ = writeln!(
                            self.code,
                            "        {cost}[{l},{}] = {}",
                            i + 1,
                            product(&format!("{port}[{l},"))
                        );
                    }
                } else {
                    let f = if cost == "xc" { "f" } else { "h" };
                    let _ = writeln!(
                        self.code,
                        "        {f}[{0}] = {1}\n.for l, 1, {last}\n        {cost}[l,{0}] = {f}[{0}]\n.endfor",
                        i + 1,
                        product(&format!("{port}["))
                    );
                }
            }
        }
        let n = system.states();
        let from = if horizon { format!("xr[{steps},j]") } else { "xr[j]".to_owned() };
        let last = match fixed {
            true => format!("sum(j, 1, {n}, Pn[i,j]*{from})"),
            false => {
                format!("{}*{} - sum(j, 1, {n}, P[i,j]*{from})", number(system.rho)?, from.replace('j', "i"))
            }
        };
        let _ = writeln!(self.code, ".rep i, 1, {n}\n        xc[{steps},i] = {last}\n.endr");
        Ok(())
    }

    fn iteration(&mut self, last: bool) -> Result<(), Error> {
        let (system, products) = (&self.controller.system, &self.products);
        let (n, m, steps) = (system.states(), system.inputs(), system.horizon);
        let with = system.references != References::None;
        let cost = |array: &str, costs: &str, at: &str| {
            if with { format!("{array}[{at}] + {costs}[{at}]") } else { format!("{array}[{at}]") }
        };
        let code = &mut self.code;
        // The underscore suppresses a warning: the last step's `_p` is never read if the horizon is unrolled.
        // Backward pass: p from the last row of costs, d = C·(Bᵀ·p + r), p = q + M·p - Kᵀ·r.
        let _ = writeln!(
            code,
            ".rep i, 1, {n}\n        _p[i] = {}\n.endr",
            cost("q", "xc", &format!("{steps},i"))
        );
        let _ = writeln!(code, ".for l, 1, {}", steps - 1);
        let _ = writeln!(
            code,
            ".rep j, 1, {m}\n        h[j] = {}\n.endr",
            cost("r", "uc", &format!("{steps}-l,j"))
        );
        for j in 0..m {
            let product = row("B", &products.b, j, true, "_p");
            let _ = writeln!(
                code,
                "        t[{0}] = h[{0}]{1}",
                j + 1,
                product.map_or(String::new(), |p| format!(" + {p}"))
            );
        }
        for i in 0..n {
            let product = row("M", &products.m, i, false, "_p").unwrap_or_else(|| "0".to_owned());
            let _ = writeln!(code, "        s[{}] = {product}", i + 1);
        }
        for j in 0..m {
            let product = row("C", &products.c, j, false, "t").unwrap_or_else(|| "0".to_owned());
            let _ = writeln!(code, "        d[{steps}-l,{}] = {product}", j + 1);
        }
        for i in 0..n {
            let own = cost("q", "xc", &format!("{steps}-l,{}", i + 1));
            let gain = row("K", &products.k, i, true, "h").map_or(String::new(), |k| format!(" - ({k})"));
            let _ = writeln!(code, "        _p[{0}] = s[{0}] + ({own}{gain})", i + 1);
        }
        code.push_str(".endfor\n");
        // Forward pass: u = -K·x - d, x = A·x + B·u, each clamped with its dual.
        let _ = writeln!(code, ".rep i, 1, {n}\n        e[i] = x[i]\n.endr\n.for l, 1, {}", steps - 1);
        for j in 0..m {
            let product = row("K", &products.k, j, false, "e").map_or(String::new(), |k| format!(" + {k}"));
            let _ = writeln!(code, "        t[{0}] = -(d[l,{0}]{product})", j + 1);
        }
        let rho = number(system.rho)?;
        let slack = |code: &mut String,
                     value: &str,
                     names: [&str; 6],
                     at: &str,
                     index: &str,
                     count: usize| {
            let [low, high, dual, cost, r, c] = names;
            let _ = writeln!(code, ".rep {index}, 1, {count}");
            let _ =
                writeln!(code, "        old = {dual}[{at},{index}]\n        total = {value}[{index}] + old");
            let _ = writeln!(
                code,
                "        within = min(max(total, {low}[{index}]), {high}[{index}])\n        over = total - within"
            );
            if last {
                let _ = writeln!(
                    code,
                    "        {r}[{index}] = max({r}[{index}], abs({value}[{index}] - within))\n        {c}[{index}] = max({c}[{index}], abs({rho}*(within - old) + {cost}[{at},{index}]))"
                );
                if value == "t" {
                    let _ = writeln!(code, "        d[{at},{index}] = within");
                }
            }
            let _ = writeln!(
                code,
                "        {dual}[{at},{index}] = over\n        {cost}[{at},{index}] = {rho}*(over - within)\n.endr"
            );
        };
        slack(code, "t", ["ul", "uh", "y", "r", "ru", "cu"], "l", "j", m);
        slack(code, "e", ["xl", "xh", "g", "q", "rx", "cx"], "l", "i", n);
        for i in 0..n {
            let product = row("A", &products.a, i, false, "e").unwrap_or_else(|| "0".to_owned());
            let _ = writeln!(code, "        s[{}] = {product}", i + 1);
        }
        for i in 0..n {
            let product = row("B", &products.b, i, false, "t").map_or(String::new(), |b| format!(" + {b}"));
            let _ = writeln!(code, "        e[{0}] = s[{0}]{product}", i + 1);
        }
        code.push_str(".endfor\n");
        slack(code, "e", ["xl", "xh", "g", "q", "rx", "cx"], &steps.to_string(), "i", n);
        Ok(())
    }
}
