// SPDX-License-Identifier: MIT OR Apache-2.0
//! Programs whose results are worked out by hand from the language's document.

use takt_interpret::Interpreter;

/// The integer output `y` at the first `wait` of a program.
#[track_caller]
fn gives(body: &str, expected: i32) {
    let text = format!(
        ".output y:int\n.array A[4] = 1, 2, 3, 4\n.array K[5]:int = 5, 4, 3, 2, 1\n.reg k:int n:int f g r[3]\n\
         .macro add d, a, b\n d = a + b\n.endm\n.macro twice what\n call what\n call what\n.endm\n\
         .once\n k = 0\n n = 3\n{body}\n wait p\n.period\np: wait p\nsub:\n .for j, 1, 5\n k = k + j\n .endfor\n ret\n"
    );
    let mut interpreter = Interpreter::new(&text).expect("it is known");
    interpreter.period(&[], 10_000).unwrap_or_else(|fault| panic!("{fault}\n{text}"));
    assert_eq!(interpreter.outputs(), [Some(expected.cast_unsigned())], "{text}");
}

#[test]
fn loops_and_calls() {
    gives(" .for i, 1, 6\n call sub\n k = k + i\n .endfor\n y = k", 6 * 15 + 21);
    gives(" .for i, 6, 1 step -2\n k = 10*1 + k - i\n .endfor\n y = k", 30 - 12);
    gives(" .for i, 1, n max 8\n n = n + 5\n k = k + i\n .endfor\n y = k", 6);
    gives(" .for i, 5, n max 8\n k = 1\n .endfor\n y = k", 0);
    gives(" .for i, 1, 3\n .for j, i, 3\n k = k + K[j]\n .endfor\n .endfor\n y = k", 5 + 2 * 4 + 3 * 3);
    gives(" .for i, 1, 3\n bz k, on\n k = k + 10\non: k = k + 1\n .endfor\n y = k", 23);
    gives(" twice sub\n y = k", 30);
}

#[test]
fn equations() {
    gives(" k, n = n, k\n y = k - n", 3);
    gives(" y = ftoi(sum(i, 1, 4, A[i]*A[i])) + sum(i, 2, 1, K[i])", 30);
    gives(" A[2:4] = A[1:3]\n y = ftoi(A[2] + 10*A[3] + 100*A[4])", 321);
    gives(" f = add(A[1], A[4]*2) + 1\n g = add(f, f)\n y = ftoi(g)", 20);
    gives(" r[:] = 0.5\n .rep i, 1, 3\n r[i] = r[i] + i\n .endr\n y = ftoi(r[1] + r[2] + r[3])", 8);
    gives(
        " .for i, 1, 3\n .if i == 2\n k = 7\n .elif i == 3\n k = k + 1\n .else\n k = 5\n .endif\n .endfor\n y = k",
        8,
    );
    gives(" f = 2.5\n sel f, k, f, 4.5\n y = f < 4 ? 1 + k : n - 1", 2);
    gives(" y = (-7 >> 1) + (1 << 4) + (n != 3) + (!k) + (n & 6 | 1)", -4 + 16 + 1 + 3);
}

#[test]
fn rejects_unsupported_operations() {
    for (text, part) in [
        (".once\n nope a\n", "neither an instruction nor a macro"),
        (".reg a b\n.once\n a = b\n wait p\n.period\np: wait p\n", "read before it is written"),
        (".array A[3]\n.reg n:int\n.once\n n = 4\n A[n] = 1\n wait p\n", "no element"),
        (".once\np: jmp p\n", "no `wait`"),
        (".deadline y = 3\n", "not known"),
    ] {
        let fault = Interpreter::new(text).and_then(|mut program| program.period(&[], 100)).expect_err(text);
        assert!(fault.contains(part), "{fault}");
    }
}
