# SPDX-License-Identifier: MIT OR Apache-2.0
"""The table of proofs: what is compared with what, for each unit."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Proof:
    """A unit's circuit compared with a reference, in the miter that is named."""

    name: str
    units: tuple  # units that the proof covers; the circuit is the first unit's
    miter: str = ""
    parts: int = 512  # number of cases: `part` of the miter is below it; in an enumeration, of sign and exponent
    reference: str = ""  # options for yosys' symfpu
    others: tuple = ()  # further files of the miter
    tables: tuple = ()  # tables of the units that the miter reads, without registers
    boxed: tuple = ()  # modules cut out of the circuit, whose results are arbitrary
    cut: bool = False  # the reference's multiplication or division is cut out, too
    exponents: bool = False  # the reference's sum of the factors' exponents is cut out, too
    given: tuple = ()  # wires and registers of the circuit that are arbitrary, except with `exact`
    shown: tuple = ()  # wires and registers that the miter reads
    iterative: bool = False  # the unit is unrolled (unrolled.py); `given` names registers with a cycle, as rest_6
    stepped: tuple = ()  # registers before and after a step
    held: tuple = ()  # registers that a step only reads, observed before it
    steps: range = range(0)  # cycles that are steps
    enumerated: str = ""  # instruction whose operands are enumerated (enumerated.py), instead of a miter
    simulated: bool = False  # of an enumeration: of the unit's circuit in Verilator, instead of its gates
    table: str = ""  # table whose words are compared with the specification's (tables.py), instead of a miter
    exact: bool = True  # the miter also exists without arbitrary values
    defines: tuple = ()
    parameter: tuple = ()  # text of a parameter's default, and its replacement
    module: str = ""  # circuit, if other than the unit's
    text: str = ""
    share: bool = False  # the proof takes seconds and is part of `cargo evidence check`

    @property
    def top(self):
        """The module that is compared."""
        return self.table or self.module or f"takt_{self.units[0]}"


PRODUCT = "takt_significand_product"
MULTIPLIED = {"others": ("product_of.v", "leading_zeros.v"), "boxed": (PRODUCT,), "cut": True}

SUM, MULTIPLICATION = "-op add -rm RNE", "-op mul -rm RNE"

PROOFS = [
    Proof(
        "alu", ("alu",), "alu.v", 64, "-compare", share=True,
        text="all operations, all operands",
    ),
    Proof(
        "alu_late", ("alu_late",), "alu.v", 64, "-compare",
        text="all operations, all operands",
    ),
    Proof(
        "convert", ("convert",), "convert.v", 2, others=("convert_of.v",), share=True,
        text="itof, ftoi, all operands",
    ),
    Proof(
        "product", ("multiply", "fused"), "product.v", 64, boxed=("takt_product",), module=PRODUCT, share=True,
        text="the significands' product, from products of 18 bits",
    ),
    Proof(
        "product.small", ("addmul",), "product.v", 64, boxed=("takt_product",), module=PRODUCT, share=True,
        parameter=("SMALL = 0", "SMALL = 1"), text="the same, as addmul has it",
    ),
    Proof(
        "multiply", ("multiply",), "multiply.v", 50, MULTIPLICATION, defines=("OP=1'b0",), share=True, **MULTIPLIED,
        text="fmul, all operands",
    ),
    *(
        Proof(
            f"{unit}.integers", (unit,), "integers.v", 1, boxed=(PRODUCT,), defines=defines, share=True,
            text="imul24, all operands, from the significands' product",
        )
        for unit, defines in [
            ("multiply", ("OP=1'b1",)), ("addmul", ("OP=3'b011",)), ("fused", ("OP=4'b0101", "FUSED")),
        ]
    ),
    Proof(
        "add", ("add",), "add.v", 56, SUM,
        text="fadd, fsub, all operands",
    ),
    Proof(
        "addmul", ("addmul",), "addmul.v", 58, SUM, others=("convert_of.v",), boxed=(PRODUCT,),
        text="fadd, fsub, itof, ftoi, all operands",
    ),
    Proof(
        "addmul.product", ("addmul",), "multiply.v", 50, MULTIPLICATION, defines=("OP=3'b010",), share=True, **MULTIPLIED,
        text="fmul, all operands",
    ),
    Proof(
        "fused.product", ("fused",), "multiply.v", 50, MULTIPLICATION, defines=("OP=4'b0100", "FUSED"),
        **MULTIPLIED, text="fmul, all operands",
    ),
    Proof(
        "fused.sum", ("fused",), "fused_sum.v", 56, SUM, boxed=(PRODUCT,),
        text="fadd, fsub, all operands",
    ),
    Proof(
        "fused", ("fused",), "fused.v", 217, "-op muladd -rm RNE", others=("leading_zeros.v",), boxed=(PRODUCT,),
        cut=True, exponents=True, given=("exponents",), text="fma, fms, fnma, fnms, all operands, from a normalised product",
    ),
    Proof(
        "fused.operands", ("fused",), "fused_operands.v", 1, "-op muladd -rm RNE", others=("leading_zeros.v",), boxed=(PRODUCT,),
        cut=True, exponents=True, shown=("exponents",), exact=False, share=True, text="what that product and its exponent are",
    ),
    Proof(
        "fused.shift", ("fused",), "fused_shift.v", 216, boxed=(PRODUCT,), given=("exponents",), exact=False,
        text="that normalising the product changes nothing",
    ),
    Proof(
        "divroot", ("divroot",), "divide.v", 68, "-op div -rm RNE", others=("leading_zeros.v",), boxed=("takt_product",), cut=True,
        given=("s_9", "last_9"), exact=False, share=True,
        text="fdiv, all operands, from its digits",
    ),
    Proof(
        "divroot.operands", ("divroot",), "divide_operands.v", 1, others=("leading_zeros.v",),
        boxed=("takt_product", "takt_reciprocal_table"), shown=("x_4", "b_4", "y_4"), exact=False, share=True,
        text="what the digits of fdiv are made of",
    ),
    Proof(
        "divroot.digits", ("divroot",), "divide_digits.v", 1, boxed=("takt_product",), given=("x_4", "b_4", "y_4"),
        shown=("s_9", "last_9", "residual_7"), exact=False, share=True,
        text="the digits of fdiv, from the reciprocal and products of 18 bits",
    ),
    Proof(
        "root", ("divroot",), "root.v", 3, others=("leading_zeros.v",), boxed=("takt_product",), given=("s_9", "last_9"), exact=False,
        share=True, text="fsqrt, all operands, from its digits",
    ),
    Proof(
        "root.operands", ("divroot",), "root_operands.v", 1, others=("leading_zeros.v",),
        boxed=("takt_product", "takt_reciprocal_table"), shown=("x_4", "y_4"), exact=False, share=True,
        text="what the digits of fsqrt are made of",
    ),
    Proof(
        "root.digits", ("divroot",), "root_digits.v", 1, boxed=("takt_product",), given=("x_4", "b_4", "y_4"),
        shown=("s_9", "last_9", "residual_7"), exact=False, share=True,
        text="the digits of fsqrt, from the reciprocal root and products of 18 bits",
    ),
    Proof(
        "recurrence", ("recurrence",), "recurrence_quotient.v", 68, "-op div -rm RNE", others=("leading_zeros.v",), cut=True,
        iterative=True, given=("digits_19", "rest_19"), exact=False, share=True, text="fdiv, all operands, from its digits",
    ),
    Proof(
        "recurrence.root", ("recurrence",), "recurrence_root.v", 3, others=("leading_zeros.v",), iterative=True,
        given=("digits_19", "rest_19"), exact=False, share=True, text="fsqrt, all operands, from its digits",
    ),
    Proof(
        "recurrence.digits", ("recurrence",), "recurrence_digits.v", 2, iterative=True, exact=False, share=True,
        stepped=("rest", "known", "place", "digits", "wait_digits"), steps=range(6, 19), text="the digits of both, step by step",
    ),
    Proof(
        "arctangent", ("arctangent",), "arctangent_angle.v", 86, iterative=True, exact=False, share=True,
        given=("e_3", "steep_3", "left_3", "sign_3", "nan_3", "none_3", "quotient_19", "angle_19"),
        text="fatan2, all operands, from its digits",
    ),
    Proof(
        "arctangent.operands", ("arctangent",), "arctangent_operands.v", 1, others=("leading_zeros.v",), iterative=True, exact=False,
        share=True, text="what the digits begin with",
    ),
    Proof(
        "arctangent.order", ("arctangent",), "arctangent_order.v", 17, iterative=True, exact=False,
        tables=("takt_arctangent_table",), given=("e_3", "dividend_3", "divisor_3", *(f"rest_{stage}" for stage in range(3, 19))),
        text="which digits there are, divisors, row of the table, quotient",
    ),
    *(
        Proof(
            f"arctangent.{name}", ("arctangent",), "arctangent_digit.v", 1, iterative=True, exact=False, share=True,
            stepped=stepped, held=held, steps=steps, defines=(name.upper(),), text=f"{text} digit",
        )
        for name, stepped, held, steps, text in [
            ("first", ("rest", "digit_1"), ("divisor", "e"), range(3, 4), "the first"),
            ("next", ("rest", "digit_1"), ("divisor", "stands"), range(4, 18), "each"),
            ("last", ("digit_1",), ("rest", "divisor"), range(18, 19), "the last"),
        ]
    ),
    *(
        Proof(name, (name.partition(".")[0],), parts=1, table=table, share=True, text=text)
        for name, table, text in [
            ("divroot.table", "takt_reciprocal_table", "every word of its table, and the bound on the digits' error"),
            ("sine.multiples", "takt_quarter_table", "every word of the table of multiples"),
            ("sine.polynomials", "takt_wave_table", "every word of the tables of coefficients"),
            ("arctangent.table", "takt_arctangent_table", "every word of its table, and their bounds"),
            ("arccosine.table", "takt_arccosine_table", "every word of its tables"),
        ]
    ),
    Proof("sine", ("sine",), enumerated="fsin", text="fsin, all operands, one after the other"),
    Proof("cosine", ("sine",), enumerated="fcos", text="fcos, all operands, one after the other"),
    Proof("arccosine", ("arccosine",), enumerated="facos", text="facos, all operands, one after the other"),
    *(
        Proof(f"{name}.circuit", (unit,), enumerated=operation, simulated=True, text=f"{operation}, operands one after the other, the circuit in Verilator")
        for name, unit, operation in [("sine", "sine", "fsin"), ("cosine", "sine", "fcos"), ("arccosine", "arccosine", "facos")]
    ),
]

# Registers whose values the timing proof of a unit takes one by one (balance.py).
SPLITS = {
    # The exponent: it chooses a row and a length of the division.
    "arctangent": ("e", 2, [*(f"00000{low:04b}" for low in range(16)), *("0" * zeros + "1" + "-" * (8 - zeros) for zeros in range(5))]),
}

# Units whose timing proof takes long: left out of `cargo evidence check`.
SLOW = ("arctangent", "sine")

# Faults in addition to ../tests/faults.rs, most of them in the timing: (text to replace, replacement).
MUTANTS = {
    "alu_late": [
        ("{out_valid, result, flags} = waiting", "{result, out_valid, flags} = waiting"),
        ("waiting[36*WAIT-1 -: 36]", "waiting[36*WAIT-2 -: 36]"),
        (".b(b), .c(c)", ".b(c), .c(b)"),
        (".op(op)", ".op(op ^ 6'd1)"),
    ],
    "arctangent": [
        ("out_valid <= at[22]", "out_valid <= at[21]"),
        ("clk) if (at[2]) begin", "clk) if (at[2] | at[12]) begin"),
        ("if (at[2])       rest <=", "if (at[2] | at[9]) rest <="),
        ("if (at[2])       divisor <=", "if (at[2] | at[9]) divisor <="),
        ("{quotient[25:0], high, low}", "{quotient[25:0], high, low} ^ {28{at[1]}}"),
    ],
    "arccosine": [
        ("out_valid <= at[28]", "out_valid <= at[27]"),
        ("q        <= 27'd1;", ""),
        ("clk) if (at[2]) begin", "clk) if (at[2] | at[12]) begin"),
        ("at        <= {at[27:1], in_valid}", "at        <= {at[26:1], in_valid, in_valid}"),
        ("rest     <= {26'd0, r2[31] & r2[30], r2[31] & ~r2[30]};", ""),
    ],
    "divroot": [
        ("out_valid <= valid[9]", "out_valid <= valid[8]"),
        ("root[8] ? {14'b0, q2_8, 1'b0}", "root[9] ? {14'b0, q2_8, 1'b0}"),
        ("y_5         <= y_4", "y_5         <= {1'b1, coarse_3}"),
        ("sign_5      <= sign_4", "sign_5      <= sign_3"),
        ("q1_7       <= q1_6", "q1_7       <= q1_5"),
    ],
    "sine": [
        ("field12    <= field11", "field12    <= field10"),
        ("cosine4   <= quadrant3[0] ^ op3", "cosine4   <= quadrant3[0] ^ op2"),
        ("fixed4    <= fixed3", "fixed4    <= fixed2"),
        ("negative6 <= negative5 ^", "negative6 <= negative4 ^"),
        ("c0_7 + {20'd0, bend7}", "c0_7 + {20'd0, bend}"),
    ],
    "recurrence": [
        ("out_valid <= at[19]", "out_valid <= at[18]"),
        ("if (at[4]) begin", "if (at[3]) begin"),
        ("if (at[3]) begin", "if (at[2] | at[3]) begin"),
        ("digits      <= 25'd0", "digits      <= digits"),
        ("if (~at[4]) start_5 <= 25'd0;", ""),
    ],
}

# Faults in tables: one bit of one word. `cargo evidence check` plants the first of each unit.
TABLE_MUTANTS = {
    "divroot": [
        ("coarse_words[697] = 15'h1850", "coarse_words[697] = 15'h184f"),
        ("fine_words[700] = 6'h14", "fine_words[700] = 6'h15"),
    ],
    "sine": [
        ("value_words[161] = 57'h11a0f0011fa3bba", "value_words[161] = 57'h11a0f0011fa3bbb"),
        ("coefficients_words[695] = 46'h082215c56732", "coefficients_words[695] = 46'h082215c56733"),
        ("bend_words[700] = 8'h4a", "bend_words[700] = 8'h4b"),
    ],
    "arctangent": [("angle_words[161] = 31'h60ed74e2", "angle_words[161] = 31'h60ed74e3")],
    "arccosine": [
        ("value_words[697] = 27'h4566a88", "value_words[697] = 27'h4566a89"),
        ("slope_words[700] = 15'h3da2", "slope_words[700] = 15'h3da3"),
    ],
}

# Units whose first mutant is part of `cargo evidence check`.
SHARED_MUTANTS = ("add", "alu")
