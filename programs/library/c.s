; Operations of C that the machine has no instruction for, as `takt cc` uses them. `.include <c.s>`.

; ---- Bits ---------------------------------------------------------------------------------------------------------------------

; The bits of a float as an integer, and the float of these bits.
.macro  bits_of d:int, x:bits
        mov     d:bits, x
.endm
.macro  float_of d:float, n:bits
        mov     d:bits, n
.endm

; n shifted right by k bits, zeros shifted in.
.macro  shift_right d:int, n:int, k:int
        ishr    d, n, k
.endm

; 1 if a < b as unsigned integers, otherwise 0.
.macro  below d:int, a:int, b:int
        iltu    d, a, b
.endm

; ---- Conversions --------------------------------------------------------------------------------------------------------------

; x truncated to an integer, as (int)x: the nearest integer, and one less in size if that is beyond x. Beyond ±2^31 the nearest end.
.macro  to_int d:int, x:float
.reg    n:int over:int
        n = ftoi(x)
        over = abs(itof(n)) > abs(x)
        d = n < 0 ? n + over : n - over
.endm

; x truncated to an integer from 0 to 2^32 - 1, as (unsigned)x.
.macro  to_unsigned d:int, x:float
.reg    high:int part
        high = x >= 2147483648.0
        part = high ? x - 2147483648.0 : x
        d = to_int(part) + (high << 31)
.endm

; n from 0 to 2^32 - 1 as a float: half of it, whose last bit stands for both that are lost, doubled.
.macro  unsigned_to_float d:float, n:int
.reg    half:int whole near
        half = shift_right(n, 1) | (n & 1)
        whole = itof(n)
        near = itof(half)
        d = n < 0 ? near + near : whole
.endm

; ---- Products -----------------------------------------------------------------------------------------------------------------

; The high word of a·b, both from 0 to 2^32 - 1: the product of the upper parts of 16 bits, and the carries from the others.
.macro  product_high d:int, a:int, b:int
.reg    a0:int a1:int b0:int b1:int low:int high:int
        a0, a1 = a & 65535, shift_right(a, 16)
        b0, b1 = b & 65535, shift_right(b, 16)
        low = mul24(a1, b0) + shift_right(mul24(a0, b0), 16)
        high = mul24(a0, b1) + (low & 65535)
        d = mul24(a1, b1) + shift_right(low, 16) + shift_right(high, 16)
.endm

; ---- Quotients ----------------------------------------------------------------------------------------------------------------

; a/b of integers from -2^24 to 2^24, truncated: between a/b and the next integer lies a float, so that none is rounded to it.
.macro  quotient_short d:int, a:int, b:int
        d = to_int(itof(a)/itof(b))
.endm

; n + 1, n or n - 1: the one whose remainder has the sign of a. The remainder of n by b is rest, at most b in size.
.macro  truncated d:int, n:int, rest:int, a:int, b:int
.reg    beyond:int same:int
        beyond = a < 0 ? rest > 0 : rest < 0
        same = xor(rest, b) >= 0
        d = n + (beyond & same) - (beyond & !same)
.endm

; a/b of integers, truncated. The floats' quotient is off by 385 at most, which the rest's quotient mends but for one; the factor keeps
; 2^31 out of ftoi's operand.
.macro  quotient d:int, a:int, b:int
.reg    y near:int rest:int step:int
        y = itof(b)
        near = ftoi(0.9999999*itof(a)/y)
        rest = a - near*b
        step = ftoi(itof(rest)/y)
        d = truncated(near + step, rest - step*b, a, b)
.endm

; The same by a number b, neither 0, 1 nor -1, whose inverse is given.
.macro  quotient_by d:int, a:int, b:int, inverse:float
.reg    near:int rest:int step:int
        near = ftoi(inverse*itof(a))
        rest = a - near*b
        step = ftoi(inverse*itof(rest))
        d = truncated(near + step, rest - step*b, a, b)
.endm

; The same for a from -2^22 to 2^22: the nearest integer is off by one at most.
.macro  quotient_short_by d:int, a:int, b:int, inverse:float
.reg    near:int
        near = ftoi(inverse*itof(a))
        d = truncated(near, a - near*b, a, b)
.endm

; a/b of integers from 0 to 2^32 - 1: twice the quotient of a/2, and one more if the rest has b in it. From 2^31 on b fits once or not.
.macro  quotient_unsigned d:int, a:int, b:int
.reg    half:int
        half = quotient(shift_right(a, 1), b) << 1
        d = b < 0 ? !below(a, b) : half + !below(a - half*b, b)
.endm

; The same by a number b from 2 to 2^31 - 1, whose inverse is given.
.macro  quotient_unsigned_by d:int, a:int, b:int, inverse:float
.reg    half:int
        half = quotient_by(shift_right(a, 1), b, inverse) << 1
        d = half + !below(a - half*b, b)
.endm
; SPDX-License-Identifier: MIT OR Apache-2.0
