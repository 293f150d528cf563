; Macros that any program may use: `.include <math.s>`.

; y = x, held between low and high.
.macro clamp y:float, x:float, low:float, high:float
        fmax    y, x, low
        fmin    y, y, high
.endm

; ---- Elementary functions. Their errors are measured over every operand; what they cost, how they work and what they raise stands in
;      docs/library.md. Names that begin with `math.` are not for use outside. ----
.contract off                           ; the errors are those of the operations as they stand
.const math.shift = 0x1.8p23            ; added to a number below 2²², it leaves the nearest integer in the low bits of the sum
.const math.sign  = 0x80000000
.const math.inf   = 0x7f800000
.const math.top   = 0xfffff000          ; keeps 12 digits: products of two such are exact
.const math.ln2h  = 0x1.62e4p-1         ; 15 digits
.const math.ln2l  = log(2) - math.ln2h
.const math.pi2a  = 0x1.921ep0          ; π/2 in parts, whose products with integers to 256 are exact
.const math.pi2b  = 0x1.b544p-16
.const math.pi2c  = 0x1.0b4611a626331p-34
.const math.pi2h  = 0x1.921fb6p0        ; π/2, nearest binary32
.const math.pi2l  = -0x1.777a5cp-25     ; and the rest
.const math.pih   = 0x1.921fb6p1        ; π, likewise
.const math.pil   = -0x1.777a5cp-24

; ---- Rounding to integers ------------------------------------------------------------------------------------------------------

; What the roundings share: the operand's magnitude, whether it has both a whole part and a fraction (1 ≤ |x| < 2²³), and by
; how much to shift a mask of the fraction.
.macro math.units x:float, a:int, inner:int, s:int
.reg    e:int off:int
        iand    a, x, 0x7fffffff
        ishr    e, x, 23
        iadd    s, e, 1                 ; exponent - 127, modulo 32: shifts look at no more
        isub    off, a, 0x3f800000
        iltu    inner, off, 0x4b000000 - 0x3f800000
.endm

; d = x towards zero, exact.
.macro trunc d:float, x:float
.reg    a:int inner:int s:int keep:bits whole:bits less:int sg:bits rest:bits
        math.units x, a, inner, s
        isar    keep, 0xff800000, s
        iand    whole, x, keep
        iand    sg, x, math.sign
        ilt     less, a, 0x3f800000
        sel     rest, less, sg, x
        sel     d, inner, whole, rest
.endm

; Towards the infinity of the sign bit `side`: on that side, what has a fraction grows to the next integer.
.macro math.toward d:float, x:float, side:int, one:float
.reg    xb:bits a:int inner:int s:int keep:bits below:bits mine:int grow:bits whole:bits less:int sg:bits rest:bits
.reg    y:bits some:int up:int
        math.units x, a, inner, s
        isar    keep, 0xff800000, s
        ishr    below, 0x7fffff, s
        iand    sg, x, math.sign
        ieq     mine, sg, side
        sel     grow, mine, below, 0
        ior     xb, a, sg
        iadd    y, xb, grow
        iand    whole, y, keep
        ilt     some, zero, a
        iand    up, mine, some
        sel     rest, up, one, sg
        ilt     less, a, 0x3f800000
        sel     rest, less, rest, x
        sel     d, inner, whole, rest
.endm

; d = the greatest integer not above x, exact.
.macro floor d:float, x:float
        math.toward d, x, math.sign, -1.0
.endm

; d = the least integer not below x, exact.
.macro ceil d:float, x:float
        math.toward d, x, 0, 1.0
.endm

; d = the nearest integer, halves away from zero, exact.
.macro round d:float, x:float
.reg    xb:bits a:int inner:int s:int keep:bits half:bits whole:bits less:int sg:bits one:bits big:int rest:bits
.reg    y:bits
        math.units x, a, inner, s
        isar    keep, 0xff800000, s
        ishr    half, 0x400000, s
        iand    sg, x, math.sign
        ior     xb, a, sg
        iadd    y, xb, half
        iand    whole, y, keep
        ior     one, sg, bits(1.0)
        ilt     big, a, 0x3f000000
        sel     rest, big, sg, one
        ilt     less, a, 0x3f800000
        sel     rest, less, rest, x
        sel     d, inner, whole, rest
.endm

; d = the nearest integer, halves to even, as the machine rounds; exact.
.macro rint d:float, x:float
.reg    a:int sg:bits m y z w:bits whole:int
        iand    a, x, 0x7fffffff
        iand    sg, x, math.sign
        ior     m, sg, bits(0x1p23)
        fadd    y, x, m
        fsub    z, y, m
        ior     w, z, sg
        ilt     whole, 0x4affffff, a
        sel     d, whole, x, w
.endm

; ---- Exponential and logarithm -------------------------------------------------------------------------------------------------

; e^r - 1 - r, |r| ≤ ln(2)/2.
.macro math.exp_tail q:float, r:float
.reg    r2 p0 p1 p2 s0 s1 s2 s3
        fmul    r2, r, r
        fmul    s0, r, 0x1.55548cp-3
        fadd    p0, s0, 0x1.fffffcp-2
        fmul    s1, r, 0x1.123d72p-7
        fadd    p1, s1, 0x1.55585ap-5
        fmul    s2, r2, 0x1.6ab8f2p-10
        fadd    p1, p1, s2
        fmul    s3, p1, r2
        fadd    p2, p0, s3
        fmul    q, p2, r2
.endm

; d = e^x, at most 0.81123 ulp.
.macro exp d:float, x:float
.reg    c t:bits n nh nl a r hi h lo q v y:bits k:int k1:int k2:int w:bits big:int f:bits
        fsat    c, x, 104.0
        fmul    t, c, 1/log(2)
        fadd    t, t, math.shift
        fsub    n, t, math.shift
        fmul    nh, n, math.ln2h        ; exact
        fsub    a, c, nh                ; exact
        fmul    nl, n, math.ln2l
        fsub    r, a, nl
        fadd    hi, r, 1.0
        fsub    h, hi, 1.0
        fsub    lo, r, h
        math.exp_tail q, r
        fadd    v, lo, q
        fadd    y, hi, v
        ; times 2^n, as two factors, of which the first is an addition to the exponent
        ishl    k, t, 23
        isar    k1, k, 1
        iand    k1, k1, 0xff800000
        isub    k2, k, k1
        iadd    w, k2, bits(1.0)
        feq     big, x, inf
        sel     f, big, x, w            ; infinity is no overflow
        iadd    y, y, k1
        fmul    d, y, f
.endm

; e = unit·(e^c - 1), as (2ⁿ·unit·hi - unit) + 2ⁿ·unit·lo with the parts of `exp`; c in [-20, 89], unit 1/2 or 1.
.macro math.less_one e:float, c:float, unit:number
.reg    t shifted:bits n nh nl a r hi h lo q v k:int two:bits whole all part
        fmul    t, c, 1/log(2)
        fadd    shifted, t, math.shift
        fsub    n, shifted, math.shift
        fmul    nh, n, math.ln2h        ; exact
        fsub    a, c, nh                ; exact
        fmul    nl, n, math.ln2l
        fsub    r, a, nl
        fadd    hi, r, 1.0
        fsub    h, hi, 1.0
        fsub    lo, r, h
        math.exp_tail q, r
        fadd    v, lo, q
        ishl    k, shifted, 23
        iadd    two, k, bits(unit)      ; 2^n·unit
        fmul    whole, hi, two          ; exact
        fsub    all, whole, unit
        fmul    part, v, two
        fadd    e, all, part
.endm

; d = e^x - 1, at most 1.25283 ulp: twice its half, so that 2ⁿ⁻¹ has a number always.
.macro expm1 d:float, x:float
.reg    low c e size:int off:int inner:int sg:bits e0 e1
        fmax    low, x, -20.0           ; below -17.33 the result is -1
        fmin    c, low, 89.0            ; above 88.73 it overflows
        math.less_one e, c, 0.5
        ; up to 2^-25 the result is x, and so is infinity, or a NaN
        iand    size, low, 0x7fffffff
        isub    off, size, 0x33000000
        iltu    inner, off, 0x4c800000
        iand    sg, x, math.sign
        sel     e0, inner, e, x
        sel     e1, inner, e, sg
        fadd    d, e0, e1
.endm

; d = ln x, at most 0.81752 ulp.
.macro log d:float, x:float
.reg    a:bits up xs:bits sub:int off:int t:int eb:int m:bits ei:int e f eh h l l1 el f2 f4 hf f3 q a0 a1 a2 a3 s0 s1
.reg    s2 s3 s4 s5 s6 s7 num den z:bits isinf:int
        iand    a, x, 0x7fffffff
        itof    up, a                   ; of a subnormal: x·2^149
        ilt     sub, a, 0x00800000
        sel     xs, sub, up, a
        sel     off, sub, -149, 0
        isub    t, xs, 0x3f2aaaab       ; 2/3
        iand    eb, t, 0xff800000
        isub    m, xs, eb               ; in [2/3, 4/3)
        isar    ei, t, 23
        iadd    ei, ei, off
        itof    e, ei
        fsub    f, m, 1.0
        fmul    eh, e, math.ln2h        ; exact
        fadd    h, eh, f
        fsub    l, h, eh
        fsub    l1, f, l
        fmul    el, e, math.ln2l
        ; poles and what has no logarithm: -1/0, 0/0
        sel     num, a, zero, -1.0
        fmax    den, x, zero
        fdiv    z, num, den
        feq     isinf, x, inf
        sel     z, isinf, x, z
        fadd    el, el, z
        fadd    l1, l1, el
        fmul    f2, f, f
        fmul    hf, f2, 0.5
        fsub    l1, l1, hf
        fmul    f4, f2, f2
        fmul    f3, f2, f
        fmul    s0, f, -0x1.ffff02p-3
        fadd    a0, s0, 0x1.555556p-2
        fmul    s1, f, -0x1.559bb0p-3
        fadd    a1, s1, 0x1.99985ep-3
        fmul    s2, f, -0x1.f33a42p-4
        fadd    a2, s2, 0x1.24d7b2p-3
        fmul    s3, f, -0x1.07a414p-3
        fadd    a3, s3, 0x1.bb4124p-4
        fmul    s4, f2, a1
        fadd    a0, a0, s4
        fmul    s5, f2, 0x1.e07c02p-4
        fadd    a3, a3, s5
        fmul    s6, f2, a3
        fadd    a2, a2, s6
        fmul    s7, f4, a2
        fadd    a0, a0, s7
        fmul    q, a0, f3
        fadd    l1, l1, q
        fadd    d, h, l1
.endm

; d = ln(1 + x), at most 1.4375 ulp: ln of the sum, and what the sum lost as its part.
.macro log1p d:float, x:float
.reg    u l c b m lost den q s a:int null:int
        fadd    u, x, 1.0
        log     l, u
        fmin    c, x, 0x1p40            ; beyond, nothing that is lost counts
        fadd    b, c, 1.0
        fsub    m, b, 1.0
        fsub    lost, c, m
        fmax    den, b, 0x1p-30         ; -1 has its pole from `log`
        fdiv    q, lost, den
        fadd    s, l, q
        iand    a, x, 0x7fffffff
        ieq     null, a, zero
        sel     d, null, x, s           ; keeps the sign of zero
.endm

; ---- Angles -----------------------------------------------------------------------------------------------------------------

; x = n·π/2 + r - rl, n in the lowest bits of t; r is NaN where |x| > 2π·64.
.macro math.reduce r:float, rl:float, t:bits, x:float
.reg    a:int in:int xs:bits q n y1 y2 v w g0 u g1 l0
        iand    a, x, 0x7fffffff
        ilt     in, a, 0x43c90fdb       ; beyond 2π·64 (and for a NaN) the operand becomes an infinity, the rest is invalid
        sel     xs, in, x, inf
        fmul    q, xs, 2/pi
        fadd    t, q, math.shift
        fsub    n, t, math.shift
        fmul    w, n, math.pi2a         ; exact
        fsub    y1, xs, w               ; exact
        fmul    v, n, math.pi2b         ; exact
        fsub    y2, y1, v
        fsub    g0, y1, y2
        fsub    g0, g0, v               ; what y2 has lost
        fmul    u, n, math.pi2c
        fsub    r, y2, u
        fsub    g1, y2, r
        fsub    l0, u, g1
        fsub    rl, l0, g0
.endm

; ---- Tangent -------------------------------------------------------------------------------------------------------------------

; d = sin x / cos x, |x| ≤ 2π·64, at most 2.16531 ulp.
.macro tan_quick d:float, x:float
.reg    s c
        s = sin(x)
        c = cos(x)
        fdiv    d, s, c
.endm

; d = tan x, |x| ≤ 2π·64, at most 0.89898 ulp.
;
; 2·tan(r/2) = w, then w/(1 - w²/4) or, beside an odd multiple of π/2, its inverse's opposite; all in two words each.
.macro tan d:float, x:float
.reg    t:bits odd:int r nl z z2 p0 p1 p s0 s1 s2 q wh wl:bits g wz:bits wq
.reg    w3 dw w2 w2h k2 V:bits vl v1 mu:bits ml:bits nh:bits nlo:bits dh:bits dl:bits inv m ta:bits zt:bits vt k e k1
        math.reduce r, nl, t, x
        iand    odd, t, 1
        fmul    z, r, r
        fmul    z2, z, z
        fmul    s0, z, 0x1.111e7ap-7
        fadd    p0, s0, 0x1.55553ap-4
        fmul    s1, z, 0x1.a2d8c2p-14
        fadd    p1, s1, 0x1.b60f1ap-11
        fmul    s2, z2, p1
        fadd    p0, p0, s2
        fmul    p, z, p0
        fmul    q, r, p
        fsub    q, q, nl
        fadd    wh, r, q
        fsub    g, wh, r
        fsub    wl, q, g
        iand    wz, wh, math.top
        fmul    wq, wz, 0.25
        fmul    w2h, wq, wz             ; exact
        fsub    dw, wh, wz
        fadd    dw, dw, wl
        fmul    w3, wh, 0.25
        fmul    w2, w3, wh
        fadd    w3, w3, wq
        fmul    k1, w3, dw
        fsub    k2, w2h, w2
        fadd    k1, k1, k2              ; what w2 has lost
        fsub    V, 1.0, w2
        fsub    v1, 1.0, V
        fsub    v1, v1, w2
        fsub    vl, v1, k1
        ixor    mu, V, math.sign
        ixor    ml, vl, math.sign
        sel     nh, odd, mu, wh
        sel     nlo, odd, ml, wl
        sel     dh, odd, wh, V
        sel     dl, odd, wl, vl
        fdiv    inv, 1.0, dh
        fmul    m, nh, inv
        iand    ta, m, math.top
        iand    zt, dh, math.top
        fsub    vt, dh, zt
        fadd    vt, vt, dl
        fmul    k, ta, zt
        fsub    e, k, nh
        fmul    vt, vt, ta
        fsub    vt, vt, nlo
        fadd    e, e, vt
        fmul    e, e, inv
        fsub    d, ta, e
.endm

; ---- Arcsine and arctangent ----------------------------------------------------------------------------------------------------

; Of a = |x|, at most 2: `big` if it is above 1/2; there S = √(2 - 2a), in two words Sh + sl, and p = P(z) of z = (1 - a)/2; below, z = a².
.macro math.arc big:int, S:bits, Sh:bits, sl:bits, p:float, a:bits
.reg    y y2 zb zs z dd den z2 p0 p1 s0 s1 s2 s3
        ilt     big, 0x3f000000, a
        fsub    y, 1.0, a
        fadd    y2, y, y
        fmul    zb, y, 0.5
        fmul    zs, a, a
        sel     z, big, zb, zs
        fsqrt   S, y2
        iand    Sh, S, math.top
        fmul    dd, Sh, Sh
        fsub    dd, y2, dd
        fadd    den, S, Sh
        fmax    den, den, 0x1p-30       ; not zero over zero at 1
        fdiv    sl, dd, den
        fmul    z2, z, z
        fmul    s0, z, 0x1.330204p-4
        fadd    p0, s0, 0x1.5555c8p-3
        fmul    s1, z, 0x1.8c3e54p-6
        fadd    p1, s1, 0x1.747bb8p-5
        fmul    s2, z2, 0x1.595c58p-5
        fadd    p1, p1, s2
        fmul    s3, z2, p1
        fadd    p0, p0, s3
        fmul    p, p0, z
.endm

; d = arcsine of x, at most 0.72224 ulp.
.macro asin d:float, x:float
.reg    h l l1 q u hx:bits lx:bits base:bits corr:bits a0:bits a:bits big:int sg:bits S:bits S0:bits Sh:bits sl:bits s:bits p
        fabs    a0, x
        fmin    a, a0, 2.0              ; what overflows nowhere, and has no arcsine either
        iand    sg, x, math.sign
        math.arc big, S, Sh, sl, p, a
        ixor    S0, S, sg
        sel     s, big, S0, x
        ; ±(π/2 - S - …), or x + x³·P(x²)
        fsub    h, math.pi2h, Sh
        fsub    l, math.pi2h, h
        fsub    l, l, Sh
        fadd    l, l, math.pi2l
        fsub    l1, l, sl
        ixor    hx, h, sg
        ixor    lx, l1, sg
        fmul    q, s, p
        fsub    u, lx, q
        sel     base, big, hx, x
        sel     corr, big, u, q
        fadd    d, base, corr
.endm

; c and its arctangent hi for a quotient above 7/16 (b1), 11/16 (b2), 19/16 (b3), 39/16 (b4, where hi is π/2).
.macro math.tangent c:bits, hi:bits, b1:int, b2:int, b3:int, b4:int
.reg    c1:bits c2:bits h1:bits h2:bits h3:bits
        sel     c1, b1, 0x1.ffdf30p-2, zero
        sel     c2, b3, 0x1.7fb424p0, 0x1.ff2f5cp-1
        sel     c, b2, c2, c1
        sel     h1, b1, 0x1.daac30p-2, zero
        sel     h2, b3, 0x1.f70208p-1, 0x1.91b74ep-1
        sel     h3, b2, h2, h1
        sel     hi, b4, math.pi2h, h3
.endm

; u = arctangent of t, |t| ≤ 7/16.
.macro math.atan_tail u:bits, t:float
.reg    z z2 e0 e1 e2 e3 e4 p1 p2 p Q
        fmul    z, t, t
        fmul    z2, z, z
        fmul    e0, z, -0x1.555542p-2
        fmul    e1, z, -0x1.236f16p-3
        fadd    p1, e1, 0x1.998df8p-3
        fmul    e2, z, -0x1.dd3c64p-5
        fadd    p2, e2, 0x1.add6b2p-4
        fmul    e3, z2, p2
        fadd    p1, p1, e3
        fmul    e4, z2, p1
        fadd    p, e0, e4               ; +0 at 0
        fmul    Q, t, p
        fadd    u, t, Q
.endm

; The arctangent where the machine has none: atan(c) + atan((x - c)/(1 + c·x)).
.macro math.atan d:float, x:float
.reg    a:bits sg:bits A b1:int b2:int b3:int b4:int c:bits hi:bits num num4 n0:bits ca den d0:bits t u
        fabs    a, x
        iand    sg, x, math.sign
        fmin    A, a, 0x1p30
        ilt     b1, bits(7/16), a
        ilt     b2, bits(11/16), a
        ilt     b3, bits(19/16), a
        ilt     b4, bits(39/16), a
        math.tangent c, hi, b1, b2, b3, b4
        ixor    hi, hi, sg
        fsub    num, A, c
        fmul    num4, A, math.pi2l
        fsub    num4, num4, 1.0
        sel     n0, b4, num4, num
        ixor    n0, n0, sg
        fmul    ca, A, c
        fadd    den, ca, 1.0
        sel     d0, b4, A, den
        fdiv    t, n0, d0
        math.atan_tail u, t
        fadd    d, hi, u
.endm

; d = arctangent of x, at most 0.75 ulp as an instruction, at most 0.88751 ulp without.
.macro atan d:float, x:float
        .if has.fatan2
        fatan2  d, x, 1.0
        .else
        math.atan d, x
        .endif
.endm

; ---- Instructions of units that a machine may lack: where it has the unit, equations use the instruction ---------------------

.if !has.fsin
; d = sine of k quarter turns and r - rl, by both functions of the rest: base - corr.
.macro math.turned d:float, r:float, rl:float, k:int
.reg    z z2 hz h e f s0 s1 s2 sp sq c0 c1 c2 cp cq q m n odd:int base:bits corr:bits sum:bits sg:bits
        fmul    z, r, r
        fmul    z2, z, z
        fmul    s0, z, 0x1.110776p-7
        fsub    s1, 0x1.555546p-3, s0
        fmul    s2, z2, 0x1.9952fap-13
        fadd    sp, s1, s2
        fmul    sq, z, sp
        fmul    q, r, sq
        fadd    q, q, rl                ; the sine is r - q: -0 at -0
        fmul    hz, z, 0.5
        fsub    h, 1.0, hz
        fsub    e, 1.0, h
        fsub    f, hz, e                ; what h has lost
        fmul    c0, z, 0x1.6c0c28p-10
        fsub    c1, 0x1.55554ap-5, c0
        fmul    c2, z2, 0x1.99e80cp-16
        fadd    cp, c1, c2
        fmul    cq, z2, cp
        fsub    m, f, cq
        fmul    n, r, rl
        fsub    m, m, n
        iand    odd, k, 1
        sel     base, odd, h, r
        sel     corr, odd, m, q
        fsub    sum, base, corr
        ishl    sg, k, 30
        iand    sg, sg, math.sign
        ixor    d, sum, sg
.endm

; d = sine of x, |x| ≤ 2π·64, at most 0.96583 ulp.
.macro sin d:float, x:float
.reg    r rl t:bits
        math.reduce r, rl, t, x
        math.turned d, r, rl, t
.endm

; d = cosine of x, |x| ≤ 2π·64, at most 0.93541 ulp.
.macro cos d:float, x:float
.reg    r rl t:bits k:int
        math.reduce r, rl, t, x
        iadd    k, t, 1
        math.turned d, r, rl, k
.endm
.endif

.if !has.facos
; d = arccosine of x, at most 0.69925 ulp.
.macro acos d:float, x:float
.reg    a0:bits a1:bits a:bits big:int sg:bits neg:int not:int S:bits Sh:bits sl:bits bS:bits sS:bits lS:bits b s e
.reg    c cl c0:bits l0:bits p h l l1 q u
        fabs    a0, x
        fmin    a1, a0, 2.0             ; what overflows nowhere, and has no arccosine either
        ilt     not, math.inf, a0
        sel     a, not, 2.0, a1         ; a NaN
        iand    sg, x, math.sign
        ilt     neg, sg, 0
        ixor    sg, sg, math.sign
        math.arc big, S, Sh, sl, p, a
        ixor    bS, Sh, sg
        ixor    sS, S, sg
        ixor    lS, sl, sg
        sel     b, big, bS, x
        sel     s, big, sS, x
        sel     e, big, lS, zero
        sel     c0, neg, math.pih, zero
        sel     l0, neg, math.pil, zero
        sel     c, big, c0, math.pi2h
        sel     cl, big, l0, math.pi2l
        ; π/2 - x - x³·P(x²), or 0 or π, and ±(S + …)
        fsub    h, c, b
        fsub    l, c, h
        fsub    l, l, b
        fadd    l, l, cl
        fsub    l1, l, e
        fmul    q, s, p
        fsub    u, l1, q
        fadd    d, h, u
.endm
.endif

.if !has.fatan2
; d = angle of the point (x, y), at most 1.52 ulp: the arctangent of |y|/|x| as in `atan`, in the quadrant of both signs.
.macro atan2 d:float, y:float, x:float
.reg    ay:bits ax:bits ny:int nx:int not:int m:bits iy:int ix:int at:int oy:bits ox:bits fy:bits fx:bits M:bits large:int
.reg    small:int k1:bits k:bits num:bits den:bits t1 t2 t3 t4 b1:int b2:int b3:int b4:int c:bits hi:bits nc n cn dd n4
.reg    nn:bits d0:bits t u:bits side:bits left:int hx P:bits PL:bits H L ux r:bits sy:bits
        fabs    ay, y
        fabs    ax, x
        ilt     ny, math.inf, ay
        ilt     nx, math.inf, ax
        ior     not, ny, nx             ; one is a NaN
        fmax    m, ay, ax
        ; infinities become 1 beside 0, other operands numbers whose products neither overflow nor lose digits
        ieq     iy, ay, math.inf
        ieq     ix, ax, math.inf
        ior     at, iy, ix
        sel     oy, iy, 1.0, zero
        sel     ox, ix, 1.0, zero
        sel     fy, at, oy, ay
        sel     fx, at, ox, ax
        sel     M, at, 1.0, m
        ilt     large, 0x7e000000, M
        ilt     small, M, 0x20000000
        sel     k1, small, 0x1p64, 1.0
        sel     k, large, 0x1p-4, k1
        fmul    num, fy, k
        fmul    den, fx, k
        fmax    den, den, 0x1p-126      ; not zero over zero
        fmul    t1, den, 7/16
        fmul    t2, den, 11/16
        fmul    t3, den, 19/16
        fmul    t4, den, 39/16
        flt     b1, t1, num
        flt     b2, t2, num
        flt     b3, t3, num
        flt     b4, t4, num
        math.tangent c, hi, b1, b2, b3, b4
        fmul    nc, den, c
        fsub    n, num, nc
        fmul    cn, num, c
        fadd    dd, den, cn
        fmul    n4, num, math.pi2l
        fsub    n4, n4, den
        sel     nn, b4, n4, n
        sel     d0, b4, num, dd
        sel     nn, not, zero, nn
        sel     d0, not, zero, d0       ; NaN and invalid
        fdiv    t, nn, d0
        math.atan_tail u, t
        ; on the left, π less the angle, in two words
        iand    side, x, math.sign
        ilt     left, side, 0
        sel     P, left, math.pih, zero
        sel     PL, left, math.pil, zero
        ixor    hx, hi, side
        ixor    ux, u, side
        fadd    H, P, hx
        fsub    L, P, H
        fadd    L, L, hx
        fadd    L, L, PL
        fadd    L, L, ux
        fadd    r, H, L
        iand    sy, y, math.sign
        sel     sy, not, zero, sy
        ixor    d, r, sy
.endm
.endif

; ---- Hyperbolic tangent --------------------------------------------------------------------------------------------------------

; d = tanh x, at most 0.98208 ulp.
.macro tanh d:float, x:float
.reg    c a:bits big:int sg:bits a2 t:bits n nh b nl r hi:bits h lo q v:bits k:int H h1 Hl D num:bits base:bits corr z
.reg    z2 p1 p2 p Q s0 s1 s2 s3 s4 e0:bits e1:bits
        fsat    c, x, 10.0              ; beyond 9.02 the result is 1
        iand    sg, x, math.sign
        fabs    a, c
        ilt     big, bits(0.82), a
        ; 1 - 2/(e^2|x| + 1), e^2|x| as a sum of two
        fadd    a2, a, a
        fmul    t, a, 2/log(2)
        fadd    t, t, math.shift
        fsub    n, t, math.shift
        fmul    nh, n, math.ln2h
        fsub    b, a2, nh
        fmul    nl, n, math.ln2l
        fsub    r, b, nl
        fadd    hi, r, 1.0
        fsub    h, hi, 1.0
        fsub    lo, r, h
        math.exp_tail q, r
        fadd    v, lo, q
        ishl    k, t, 23
        iadd    hi, hi, k
        iadd    v, v, k
        fadd    H, hi, 1.0
        fsub    h1, H, hi
        fsub    Hl, 1.0, h1
        fadd    Hl, Hl, v
        fadd    D, H, Hl
        .assume D >= 1.0                ; e^2|x| + 1, which is at least 2
        ixor    num, sg, bits(-2.0)
        fdiv    corr, num, D
        ixor    base, sg, bits(1.0)
        ; x + x³·P(x²)
        fmul    z, c, c
        fmul    z2, z, z
        fmul    s0, z, -0x1.555536p-2
        fmul    s1, z, -0x1.b8fd62p-5
        fadd    p1, s1, 0x1.1109dcp-3
        fmul    s2, z, -0x1.dea5d6p-8
        fadd    p2, s2, 0x1.5be33ep-6
        fmul    s3, z2, 0x1.8fd1c2p-10
        fadd    p2, p2, s3
        fmul    s4, z2, p2
        fadd    p1, p1, s4
        fmul    p, z2, p1
        fadd    p, s0, p                ; +0 at 0
        fmul    Q, p, c
        sel     e0, big, base, c
        sel     e1, big, corr, Q
        fadd    d, e0, e1
.endm

; ---- Powers --------------------------------------------------------------------------------------------------------------------

; d = x^y, at most 0.80832 ulp.
;
; ±2^(y·log2 |x|), logarithm and product in two words each. What is not computed so (zeros, infinities, NaNs, roots of negative
; numbers) has the exponent 0 and comes out of the sign's quotient.
.macro pow d:float, x:float, y:float
.reg    ax:bits ay:bits sub:int up xs:bits off:int ti:int eb:int m:bits ei:int e k:int c u den v s sh:bits th:bits tl
.reg    a0 a1 sl s2 s4 l0 r r0 ss sh2 T T0 th2:bits g0 tl2 uu vv vv0 P ph:bits g2 pl zh z0 z1 zl dh dl b0 t1:bits c0
.reg    t2 yc ys y1:bits yl f0 f1 pl2 ph2 P1 P2 t:bits n fr w0 tt:bits x0 x1 x2 uz vz z zg w hi h lo q wv v0 yy:bits
.reg    kk:int k1:int k2:int sc:bits f yneg:int xneg:int ye:int sft:int frac:int small:int whole:int huge:int bit:int
.reg    nonint:int n1:int odd:int sg:bits xzero:int xinf:int yinf:int xone:int above:int big:int mag:bits ends:int
.reg    yi1:int notinf:int pole:int p1:int dom:int d1:int xnan:int ynan:int nan:int nv none:int still:int num:bits
.reg    g:bits S y0:int xi:int one:int
        iand    ax, x, 0x7fffffff
        iand    ay, y, 0x7fffffff
        ; what y is: 0 in nonint for a whole number, 1 in odd
        ishr    yneg, y, 31
        ishr    xneg, x, 31
        ishr    ye, ay, 23
        isub    sft, ye, 118
        ishl    frac, ay, sft
        isub    sft, 150, ye
        ishr    bit, ay, sft
        iand    bit, bit, 1
        ilt     small, ay, 0x3f800000
        ilt     whole, 0x4affffff, ay
        ilt     huge, 0x4b7fffff, ay
        sel     n1, small, 1, frac
        sel     nonint, whole, 0, n1
        sel     odd, huge, 0, bit
        sel     odd, nonint, 0, odd
        sel     sg, odd, math.sign, zero
        iand    sg, sg, x
        ; special operands
        ieq     xzero, ax, zero
        ieq     xinf, ax, math.inf
        ieq     yinf, ay, math.inf
        ieq     xone, ax, bits(1.0)
        ilt     above, bits(1.0), ax
        ixor    big, above, yneg
        sel     mag, big, math.inf, zero
        ior     ends, xzero, xinf
        sel     yi1, xone, 0, yinf
        ior     ends, ends, yi1
        sel     notinf, yinf, 0, yneg
        iand    pole, xzero, notinf
        sel     d1, nonint, xneg, 0
        sel     dom, ends, 0, d1
        ilt     xnan, math.inf, ax
        ilt     ynan, math.inf, ay
        ior     nan, xnan, ynan
        fmax    nv, x, y
        ieq     y0, ay, zero
        feq     xi, x, 1.0
        ior     one, y0, xi
        sel     num, ends, mag, bits(1.0)
        sel     num, pole, bits(1.0), num
        ior     num, num, sg
        sel     num, dom, zero, num
        sel     num, nan, nv, num
        sel     num, one, bits(1.0), num
        ior     p1, pole, dom
        ior     none, nan, one
        sel     p1, none, 0, p1
        sel     g, p1, zero, bits(1.0)
        fdiv    S, num, g
        ior     still, ends, nan
        ior     still, still, p1
        ; log2 |x| = n + log2 c + 2/(3·ln 2)·(3s + s³ + …), s = (m - c)/(m + c); (after fdlibm's e_powf.c)
        iltu    sub, ax, 0x00800000
        itof    up, ax
        sel     xs, sub, up, ax
        sel     off, sub, -149, 0
        isub    ti, xs, 0x3f5db3d7      ; √3/2
        iand    eb, ti, 0xff800000
        isub    m, xs, eb
        isar    ei, ti, 23
        iadd    ei, ei, off
        itof    e, ei
        ilt     k, bits(sqrt(1.5)), m
        sel     c, k, 1.5, 1.0
        sel     dh, k, 0x1.2b8p-1, zero
        sel     dl, k, log(1.5)/log(2) - 0x1.2b8p-1, zero
        fsub    u, m, c
        fadd    den, m, c
        fdiv    v, 1.0, den
        fmul    s, u, v
        iand    sh, s, math.top
        iand    th, den, math.top
        fsub    tl, th, c
        fsub    tl, m, tl
        fmul    a0, sh, th
        fsub    a0, u, a0
        fmul    a1, sh, tl
        fsub    a0, a0, a1
        fmul    sl, v, a0
        fmul    s2, s, s
        fmul    s4, s2, s2
        fmul    l0, s2, 0x1.5b72cep-2
        fadd    l0, l0, 0x1.b6d0ccp-2
        fmul    l0, l0, s2
        fadd    l0, l0, 0x1.333336p-1
        fmul    r, s4, l0
        fadd    ss, sh, s
        fmul    r0, sl, ss
        fadd    r, r, r0
        fmul    sh2, sh, sh
        fadd    T0, sh2, 3.0
        fadd    T, T0, r
        iand    th2, T, math.top
        fsub    g0, th2, 3.0
        fsub    g0, g0, sh2
        fsub    tl2, r, g0
        fmul    uu, sh, th2
        fmul    vv, sl, th2
        fmul    vv0, tl2, s
        fadd    vv, vv, vv0
        fadd    P, uu, vv
        iand    ph, P, math.top
        fsub    g2, ph, uu
        fsub    pl, vv, g2
        fmul    zh, ph, 0x1.ec6p-1
        fmul    z0, ph, 2/(3*log(2)) - 0x1.ec6p-1
        fmul    z1, pl, 2/(3*log(2))
        fadd    zl, z0, z1
        fadd    zl, zl, dl
        fadd    b0, zh, zl
        fadd    b0, b0, dh
        fadd    b0, b0, e
        iand    t1, b0, math.top
        fsub    c0, t1, e
        fsub    c0, c0, dh
        fsub    c0, c0, zh
        fsub    t2, zl, c0
        ; times y
        fsat    ys, y, 0x1p40
        sel     yc, still, zero, ys
        iand    y1, yc, math.top
        fsub    yl, yc, y1
        fmul    f0, yl, t1
        fmul    f1, yc, t2
        fadd    pl2, f0, f1
        fmul    ph2, y1, t1
        fsat    P1, ph2, 160.0
        fsat    P2, pl2, 1.0
        ; 2 to that power
        fadd    t, P1, P2
        fadd    t, t, math.shift
        fsub    n, t, math.shift
        fsub    fr, P1, n
        fadd    w0, fr, P2
        iand    tt, w0, 0xffff8000
        fmul    uz, tt, math.ln2h
        fsub    x0, tt, fr
        fsub    x0, P2, x0
        fmul    x1, x0, log(2)
        fmul    x2, tt, math.ln2l
        fadd    vz, x1, x2
        fadd    z, uz, vz
        fsub    zg, z, uz
        fsub    w, vz, zg
        fadd    hi, z, 1.0
        fsub    h, hi, 1.0
        fsub    lo, z, h
        math.exp_tail q, z
        fmul    wv, w, hi
        fadd    v0, lo, wv
        fadd    v0, v0, q
        fadd    yy, hi, v0
        ishl    kk, t, 23
        isar    k1, kk, 1
        iand    k1, k1, 0xff800000
        isub    k2, kk, k1
        iadd    sc, k2, bits(1.0)
        fmul    f, sc, S
        iadd    yy, yy, k1
        fmul    d, yy, f
.endm

; ---- Remainder -----------------------------------------------------------------------------------------------------------------

; d = x - trunc(x/y)·y, exact for |x| < 2^(11·steps)·|y|; beyond, NaN and invalid.
.macro fmod_in d:float, x:float, y:float, steps:number
.reg    ax:bits ay:bits xu yu xsub:int ysub:int xs:bits ys:bits xo:int yo:int ex:int ey:int D:int D0:int before:int
.reg    less:int r:bits skip:int my:bits yh:bits yl inv s:int f:bits R Q t w hi lo neg:int r1 r2 e1:int e2:int f1:bits
.reg    f2:bits o:bits sg:bits xbad:int y0:int xnan:int ynan:int nan:int bad:int nv zn z zz res:bits
        iand    ax, x, 0x7fffffff
        iand    ay, y, 0x7fffffff
        iand    sg, x, math.sign
        itof    xu, ax                  ; of a subnormal: times 2^149
        itof    yu, ay
        iltu    xsub, ax, 0x00800000
        iltu    ysub, ay, 0x00800000
        sel     xs, xsub, xu, ax
        sel     ys, ysub, yu, ay
        sel     xo, xsub, 149, 0
        sel     yo, ysub, 149, 0
        ishr    ex, xs, 23
        isub    ex, ex, xo
        ishr    ey, ys, 23
        isub    ey, ey, yo
        isub    D0, ex, ey
        ilt     before, D0, 0
        sel     D, before, 0, D0
        iand    r, xs, 0x007fffff
        ior     r, r, bits(1.0)
        iand    my, ys, 0x007fffff
        ior     my, my, bits(1.0)
        fdiv    inv, 1.0, my
        iand    yh, my, math.top
        fsub    yl, my, yh
        .rep    j, 1, steps
        ilt     less, D, 11
        sel     s, less, D, 11
        isub    D, D, s
        ishl    f, s, 23
        iadd    f, f, bits(1.0)
        fmul    R, r, f
        fmul    Q, R, inv
        fadd    t, Q, math.shift
        fsub    Q, t, math.shift
        fmul    hi, Q, yh               ; these are exact
        fsub    w, R, hi
        fmul    lo, Q, yl
        fsub    r, w, lo
        .endr
        ; what has none
        ilt     xbad, 0x7f7fffff, ax
        ieq     y0, ay, zero
        ilt     ynan, math.inf, ay
        ilt     xnan, math.inf, ax
        ior     nan, xnan, ynan
        ior     bad, xbad, y0
        ior     bad, bad, ynan
        ior     bad, bad, D             ; digits left
        ior     skip, bad, before
        fadd    r1, r, my
        ishr    neg, r, 31
        sel     r2, neg, r1, r
        sel     r2, skip, zero, r2
        isub    ey, ey, 127
        isar    e1, ey, 1
        isub    e2, ey, e1
        ishl    f1, e1, 23
        iadd    f1, f1, bits(1.0)
        ishl    f2, e2, 23
        iadd    f2, f2, bits(1.0)
        fmul    r2, r2, f1
        fmul    o, r2, f2
        ior     o, o, sg
        sel     res, before, x, o
        ; infinity times zero, but for a NaN
        fmax    nv, x, y
        sel     zn, nan, nv, inf
        sel     zz, bad, zn, zero
        fmul    z, zz, zero
        sel     d, bad, z, res
.endm

; The same for every x and y; exact.
.macro fmod d:float, x:float, y:float
        fmod_in d, x, y, 26
.endm

; ---- Functions of networks, with `tanh` ------------------------------------------------------------------------------------------

; d = tanh x, at most 5.9925 ulp, and never beyond ±1: x·P(x²)/Q(x²).
.macro tanh_quick d:float, x:float
.reg    c z z2 p0 p1 p2 q0 q1 q2 s0 s1 s2 s3 s4 s5 s6 s7 p3 n den
        fsat    c, x, 8.0
        fmul    z, c, c
        fmul    z2, z, z
        fmul    s0, z, 0x1.12044p-3
        fadd    p0, s0, 1.0
        fmul    s1, z, 0x1.c9a3b2p-27
        fadd    p1, s1, 0x1.595558p-16
        fmul    s2, z, p1
        fadd    p2, s2, 0x1.c9f854p-9
        fmul    s6, z2, p2
        fadd    p3, p0, s6
        fmul    s3, z, 0x1.de576ap-2
        fadd    q0, s3, 1.0
        fmul    s4, z, 0x1.a0b85p-21
        fadd    q1, s4, 0x1.5841d4p-12
        fmul    s5, z, q1
        fadd    q2, s5, 0x1.a7df24p-6
        fmul    s7, z2, q2
        fadd    den, q0, s7
        fmul    n, c, p3
        fdiv    d, n, den
.endm

; d = erf x, at most 6.43092 ulp, and never beyond ±1: x·P(x²)/Q(x²).
.macro erf d:float, x:float
.reg    c z z2 p0 p1 p2 p3 p4 q0 q1 q2 q3 s0 s1 s2 s3 s4 s5 s6 s7 s8 s9 n den y
        fsat    c, x, 4.0
        fmul    z, c, c
        fmul    z2, z, z
        fmul    s0, z, 0x1.987048p-3
        fadd    p0, s0, 0x1.20dd74p+0
        fmul    s1, z, 0x1.0e4f5p-8
        fadd    p1, s1, 0x1.b91c6ep-5
        fmul    s2, z, 0x1.012218p-19
        fadd    p2, s2, 0x1.2df62p-12
        fmul    s3, z2, p2
        fadd    p3, p1, s3
        fmul    s4, z2, p3
        fadd    p4, p0, s4
        fmul    s5, z, 0x1.05288p-1
        fadd    q0, s5, 1.0
        fmul    s6, z, 0x1.0123d8p-6
        fadd    q1, s6, 0x1.e2505p-4
        fmul    s7, z, 0x1.353844p-15
        fadd    q2, s7, 0x1.451abp-10
        fmul    s8, z2, q2
        fadd    q3, q1, s8
        fmul    s9, z2, q3
        fadd    den, q0, s9
        fmul    n, c, p4
        fdiv    y, n, den
        fsat    d, y, 1.0
.endm

; d = 1/(1 + e^-x), at most 2.40188 ulp.
;
; With e = e^-|x|, 1/(1 + e) or e/(1 + e): neither overflows, and small results have all their digits.
.macro sigmoid d:float, x:float
.reg    low:bits e n:bits den negative:int
        ior     low, x, math.sign
        exp     e, low
        isar    negative, x:bits, 31
        sel     n, negative, e, 1.0
        fadd    den, e, 1.0
        fdiv    d, n, den
.endm

; d = x where x > 0, otherwise e^x - 1, at most 1.06734 ulp.
.macro elu d:float, x:float
.reg    c low e off:int negative:int
        fmin    low, x, 0
        fmax    c, low, -20.0           ; below -17.33 the result is -1
        math.less_one e, c, 1.0
        isub    off, x:bits, 0x80000001
        iltu    negative, off, 0x7f800000 ; not -0, no NaN
        sel     d, negative, e, x
.endm
; SPDX-License-Identifier: MIT OR Apache-2.0
