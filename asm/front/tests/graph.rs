// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rewrites, compared with the unrewritten expressions.

use proptest::prelude::*;
use takt_front::graph::{
    Binary, Delays, Expr, Function, Graph, Id, Port, Rewrites, Unary, evaluate, optimise,
};
use takt_front::sink::Layout;

const INPUTS: usize = 4;

/// A step of a random expression: operation, and indices of earlier values.
type Step = (u8, usize, usize, usize);

/// Constants that rewrites look for, and others.
const NUMBERS: [f64; 8] = [0.0, 1.0, -1.0, 2.0, 0.5, -3.25, 0.1, 7.0];

/// Values of random steps. Each stays within a range in which every function is smooth.
fn build(graph: &Graph, steps: &[Step]) -> Vec<Id> {
    let mut values: Vec<Expr<'_>> = (0..INPUTS).map(|i| graph.input(i)).collect();
    values.extend(NUMBERS.map(|number| graph.constant(number)));
    let tame = |x: Expr<'_>| -> Id { (0.25 * x.sin()).id() };
    for &(op, a, b, c) in steps {
        let pick = |at: usize| values[at % values.len()];
        let (a, b, c) = (pick(a), pick(b), pick(c));
        let value = match op % 16 {
            0 | 1 => a + b,
            2 | 3 => a - b,
            4 | 5 => a * b,
            6 => -a,
            7 => a / (3.0 + b.binary(Binary::Mul, b)),
            8 => a * b + a * c,
            9 => a * b - c * b + a,
            10 => (1.0 + a * a).sqrt(),
            11 => a.binary(Binary::Atan2, 2.0 + b * b),
            12 => a.binary(Binary::Less, b).select(c, -c),
            13 => a.binary(Binary::Min, b),
            14 => a.cos() + a / graph.constant(4.0),
            15 if op & 32 == 0 => {
                a.unary(Unary::Tanh)
                    * graph.constant(1.0).binary(Binary::Div, 1.0 + (-(0.25 * b.sin())).unary(Unary::Exp))
            }
            _ => a.unary(Unary::Abs),
        };
        // Repeated products would leave every range.
        values.push(if op & 16 == 0 { value } else { graph.expr(tame(value)) });
    }
    values.iter().rev().take(3).map(|value| value.id()).collect()
}

fn rewrites() -> impl Strategy<Value = Rewrites> {
    any::<[bool; 7]>().prop_map(|[fold, identities, share, signs, strength, factor, balance]| Rewrites {
        fold,
        identities,
        share,
        signs,
        strength,
        factor,
        balance,
        scale: false,
    })
}

const NONE: Rewrites = Rewrites {
    fold: false,
    identities: false,
    share: false,
    signs: false,
    strength: false,
    factor: false,
    balance: false,
    scale: false,
};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if std::env::var_os("TAKT_FULL").is_some() { 20_000 } else { 400 }))]

    /// Values do not depend on the rewrites that are switched on.
    #[test]
    fn values_stay(
        steps in prop::collection::vec((any::<u8>(), 0..64usize, 0..64usize, 0..64usize), 1..40),
        rewrites in rewrites(),
        inputs in prop::array::uniform4(-2.0..2.0f64),
    ) {
        let plain = Graph::new(NONE);
        let outputs = build(&plain, &steps);
        let expected = evaluate(&plain, &outputs, &inputs);
        prop_assume!(expected.iter().all(|x| x.abs() < 1e6));
        for rewrites in [rewrites, Rewrites::ALL, Rewrites::EXACT] {
            let graph = Graph::new(rewrites);
            let outputs = build(&graph, &steps);
            let (better, at) = optimise(&graph, &outputs, &Delays::of(&takt_isa::F3), true);
            for (nodes, graph) in [(&outputs, &graph), (&at, &better)] {
                for (x, y) in evaluate(graph, nodes, &inputs).iter().zip(&expected) {
                    // A choice may fall the other way where its operands differ only in their last digits.
                    let close = (x - y).abs() <= 1e-7 * (1.0 + y.abs());
                    prop_assert!(close || rewrites != Rewrites::EXACT, "{x} is not {y}");
                    prop_assert!(close || steps.iter().any(|step| step.0 % 16 == 12), "{x} is not {y}");
                }
            }
        }
    }

    /// Exact rewrites keep every bit, except for the sign of a zero.
    #[test]
    fn exact_is_exact(
        steps in prop::collection::vec((any::<u8>(), 0..64usize, 0..64usize, 0..64usize), 1..40),
        inputs in prop::array::uniform4(-2.0..2.0f64),
    ) {
        let plain = Graph::new(NONE);
        let outputs = build(&plain, &steps);
        let expected = evaluate(&plain, &outputs, &inputs);
        prop_assume!(expected.iter().all(|x| x.is_finite()));
        let graph = Graph::new(Rewrites::EXACT);
        let outputs = build(&graph, &steps);
        let (better, at) = optimise(&graph, &outputs, &Delays::of(&takt_isa::F3), true);
        prop_assert_eq!(evaluate(&better, &at, &inputs), expected);
    }
}

/// Source of an expression of two inputs.
fn written(rewrites: Rewrites, make: fn(Expr<'_>, Expr<'_>, Expr<'_>) -> Id) -> String {
    let graph = Graph::new(rewrites);
    let id = make(graph.input(0), graph.input(1), graph.input(2));
    let port = |name: &str| Port::new(name.to_owned(), String::new());
    let inputs = vec![port("x"), port("y"), port("z")];
    let function = Function::new(graph, inputs, vec![(port("out"), id)]);
    let function = function.optimised(&Delays::of(&takt_isa::F3));
    let layout = Layout::program(&function, &takt_isa::F3).expect("ports");
    let source = takt_front::sink::source(&function, &layout);
    let lines = source.lines().filter_map(|line| line.trim().split_once(" = "));
    lines.map(|(name, value)| format!("{name} = {value}")).collect::<Vec<_>>().join("; ")
}

#[test]
fn each_rewrite_can_be_switched_off() {
    type Make = fn(Expr<'_>, Expr<'_>, Expr<'_>) -> Id;
    let cases: [(&str, Make, &str, &str); 9] = [
        ("fold", |x, _, _| ((2.0 + x.graph().constant(3.0)) * x).id(), "out = 5.0*x", "out = x*(3.0 + 2.0)"),
        ("identities", |x, _, _| (1.0 * x + 0.0 * x).id(), "out = x", "out = 1.0*x"),
        (
            "share",
            |x, y, _| ((x * y).sin() + (x * y).cos()).id(),
            "t1 = x*y; out = sin(t1) + cos(t1)",
            "out = sin(x*y) + cos(x*y)",
        ),
        (
            "signs",
            |x, y, z| (z * (y - x)).sin().binary(Binary::Add, (z * (x - y)).cos()).id(),
            "t1 = z*(x - y); out = cos(t1) - sin(t1)",
            "out = sin(z*(y - x)) + cos(z*(x - y))",
        ),
        ("strength", |x, _, _| (x / x.graph().constant(8.0)).id(), "out = 0.125*x", "out = x/8.0"),
        ("factor", |x, y, z| (x * y + x * z).id(), "out = x*(y + z)", "out = x*y + x*z"),
        ("balance", |x, y, z| (x.sin() + y + z).id(), "out = sin(x) + (y + z)", "out = z + (y + sin(x))"),
        ("signs", |x, y, _| (-(x - y)).id(), "out = y - x", "out = -(x - y)"),
        (
            "factor",
            |x, y, z| (3.0 * x - 3.0 * y + z).id(),
            "out = z + 3.0*(x - y)",
            "out = z + 3.0*x - 3.0*y",
        ),
    ];
    for (name, make, on, off) in cases {
        let mut without = Rewrites::ALL;
        assert!(without.without(name));
        let became = (written(Rewrites::ALL, make), written(without, make));
        assert_eq!((became.0.as_str(), became.1.as_str()), (on, off), "with {name}, and without");
    }
    // A sum too long for recursion, which would overflow the stack.
    let graph = Graph::new(Rewrites::ALL);
    let long = (0..200_000).fold(graph.input(0).sin(), |sum, i| {
        sum + graph.constant(f64::from(i) + 0.5) * graph.input(i as usize % 7)
    });
    let negated = (0..200_000).fold(long, |value, _| value.unary(Unary::Neg));
    let (better, at) = optimise(&graph, &[negated.id()], &Delays::of(&takt_isa::F3), true);
    assert!(evaluate(&better, &at, &[0.5; 7])[0].is_finite());
    assert!(!Rewrites::ALL.clone().without("nothing"));
    for (name, _) in Rewrites::NAMES {
        let mut without = Rewrites::ALL;
        assert!(without.without(name) && without != Rewrites::ALL, "{name}");
    }
}
