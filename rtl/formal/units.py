# SPDX-License-Identifier: MIT OR Apache-2.0
"""The table of proofs: what is compared with what, for each unit."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Proof:
    """A unit's circuit compared with a reference, in the miter that is named."""

    name: str
    units: tuple  # those that this is about; the circuit is the first one's
    miter: str = ""
    parts: int = 512  # cases: `part` of the miter is below this; of an enumeration, sign and exponent
    reference: str = ""  # options of yosys' symfpu
    others: tuple = ()  # other files of the miter
    tables: tuple = ()  # tables of the units that the miter reads, without their registers
    boxed: tuple = ()  # modules cut out of the circuit, whose results are arbitrary
    cut: bool = False  # whether the reference's multiplication or division is cut out, too
    exponents: bool = False  # whether the reference's sum of the factors' exponents is, too
    given: tuple = ()  # wires and registers of the circuit that are arbitrary, but with `exact`
    shown: tuple = ()  # wires and registers that the miter looks at
    iterative: bool = False  # whether the unit is unrolled (unrolled.py), given registers with a cycle, such as rest_6
    stepped: tuple = ()  # registers before and after a step
    held: tuple = ()  # registers that a step reads, looked at before it only
    steps: range = range(0)  # the cycles that are such steps
    enumerated: str = ""  # the instruction whose operands are tried one after the other (enumerated.py), instead of a miter
    exact: bool = True  # whether there is a miter in which nothing is arbitrary
    defines: tuple = ()
    parameter: tuple = ()  # the text of a parameter's default, and another
    module: str = ""  # the circuit, if not the unit's
    text: str = ""
    share: bool = False  # whether it is part of `cargo xtask test`

    @property
    def top(self):
        """The module that is compared."""
        return self.module or f"takt_{self.units[0]}"


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
        "multiply", ("multiply",), "multiply.v", 50, MULTIPLICATION, share=True, **MULTIPLIED,
        text="fmul, all operands",
    ),
    Proof(
        "add", ("add",), "add.v", 56, SUM, share=True,
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
        "arctangent.order", ("arctangent",), "arctangent_order.v", 17, iterative=True, exact=False, share=True,
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
    Proof("sine", ("sine",), enumerated="fsin", share=True, text="fsin, all operands, one after the other"),
    Proof("cosine", ("sine",), enumerated="fcos", share=True, text="fcos, all operands, one after the other"),
    Proof("arccosine", ("arccosine",), enumerated="facos", share=True, text="facos, all operands, one after the other"),
]

# For the timing of a unit, a register whose values are taken one by one (balance.py).
SPLITS = {
    # The exponent: it chooses a row and a length of the division.
    "arctangent": ("e", 2, [*(f"00000{low:04b}" for low in range(16)), *("0" * zeros + "1" + "-" * (8 - zeros) for zeros in range(5))]),
}

# Units whose timing takes long: not in `cargo xtask test`.
SLOW = ("arctangent", "sine")

# Faults beside those of ../tests/faults.rs, most of them in the timing: (what to replace, by what).
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

# The units whose first mutant is part of `cargo xtask test`.
SHARED_MUTANTS = ("add", "alu")
