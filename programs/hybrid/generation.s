; The hybrid robot's trajectory, on a core: blocks of G-code in, a point of the path with its derivatives out, every period. docs/generation.md.
;
; A block is the head of a FIFO. The next one is taken out and prepared while the last one runs, so that it begins in the period
; in which the last one ends. A move rests at both ends; where no block is waiting, the robot stands.

.schedule on
.if !has.fatan2
.error "generation.s needs a machine with an arctangent (takt machines), as t3"
.endif

.const  Ts    = 1e-4                    ; s, sampling period
.const  um    = 2^-28                   ; m, of an integer that is a position
.const  ua    = 2^-24                   ; rad, of one that is an angle
.const  RAPID_RAMP = 0.06               ; s, ramp of a positioning move
.const  CUT_RAMP   = 0.03               ; s, of a cutting move
.const  RADIUS     = 0.2                ; m/rad, what a rotation counts as where it is the longer way
.const  PLACE = 0                       ; kinds of blocks: stand there at once
.const  RAPID_MOVE = 1
.const  _LINE = 2                       ; any that is none of the others
.const  ARC   = 3                       ; in the XY plane, the rest follows linearly

; ---- The head of the FIFO -------------------------------------------------------------------------------------------------
.input  empty:int                       ; 1: there is none
.input  kind:int, line:int              ; line of the source, passed on
.input  to_1:int, to_2:int, to_3:int    ; um: x, y, z of the end
.input  to_4:int, to_5:int              ; ua: tilt, rotation
.input  centre_1:int, centre_2:int      ; um: of an arc
.input  sweep                           ; rad, of an arc: signed, ±2π a full circle
.input  feed                            ; m/s
.input  periods:int                     ; of the whole move; 0: as the feed says
.output pop:int                         ; takes the head out; the number of blocks taken so far

; ---- The point ----------------------------------------------------------------------------------------------------------
.output x, y, z, vx, vy, vz, ax, ay, az ; m, s
.output alpha, gamma, omega_alpha, omega_gamma, eps_alpha, eps_gamma ; rad, s
.output block:int                       ; line of the block that runs
.output standing:int                    ; 1: it is at its end

; ---- State ----------------------------------------------------------------------------------------------------------------
.state  k:int N:int                     ; period of the move, and how many it has
.state  c1 A B C                        ; of the profile: see below
.state  fh[5] fl[5] th[5] tl[5]         ; where the move begins and ends: m and rad, in two words
.state  o[5]                            ; the way between
.state  arc:int                         ; whether it is one
.state  ch[2] cl[2] r0 r1 a0 a1 turn    ; centre in two words; radius and direction at both ends; sweep
.state  taken:int now:int               ; blocks taken out; line of the one that runs
.state  ready:int                       ; the next block is prepared:
.state  nN:int nc1 nA no[5] nt[5]:int narc:int nc[2]:int nr0 nr1 na0 na1 nturn nline:int
.state  end[5]:int                      ; where it ends; um, ua

.once
        k, N, ready, taken, now, arc = 0, 0, 0, 0, 0, 0
        c1, A, B, C = 0, 0, 0, 0
        r0, r1, a0, a1, turn = 0, 0, 0, 0, 0
        nN, nc1, nA, narc, nr0, nr1, na0, na1, nturn, nline = 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
        .rep i, 1, 5
        fh[i], fl[i], th[i], tl[i], o[i], no[i], nt[i], end[i] = 0, 0, 0, 0, 0, 0, 0, 0
        .endr
        .rep i, 1, 2
        ch[i], cl[i], nc[i] = 0, 0, 0
        .endr
        pop, block, standing = 0, 0, 1
        x, y, z, vx, vy, vz, ax, ay, az = 0, 0, 0, 0, 0, 0, 0, 0, 0
        alpha, gamma, omega_alpha, omega_gamma, eps_alpha, eps_gamma = 0, 0, 0, 0, 0, 0
        wait    period

.macro  words   hi, lo, n, unit         ; an integer times its unit, exactly: hi + lo
        hi = itof(isar.of(n, 8))*(unit*256)
        lo = itof(n & 255)*unit
.endm
.macro  isar.of d, n, by
        isar    d, n, by
.endm

.period
period:
.reg    busy:int
        ior     busy, ready, empty
        bnz     busy, prepared

; ---- Prepare the next block -----------------------------------------------------------------------------------------------
; Of the whole profile, with the way L, the speed V, ramps of Tr, and ratio = L/(V·Tr), at least 1 (else V = L/Tr): it takes Tr·(1 + ratio),
; stretched to N periods. With the phase φ = c1·k, which is π at a ramp's end, c1 = π·(1 + ratio)/N, the way after k periods of the first half is
;   s/L = A·((φ' - sin φ') + 2·(φ - φ')), φ' = min(φ, π),
; and A is such that s/L is 1/2 in the middle as the phase is rounded: φ = N/2·c1 there, A = 1/(2·N·c1 - 2π).
.reg    p0x p0y p1x p1y way length ramp ratio rotation cycles nf both asked:int whole:int more:int Nc:int exists:int place:int
        .rep i, 1, 3
        no[i] = itof(to_{i} - end[i])*um
        .endr
        .rep i, 4, 5
        no[i] = itof(to_{i} - end[i])*ua
        .endr
        narc = kind == ARC
        place = kind == PLACE
        p0x, p0y = itof(end[1] - centre_1)*um, itof(end[2] - centre_2)*um
        p1x, p1y = itof(to_1 - centre_1)*um, itof(to_2 - centre_2)*um
        nr0, nr1 = sqrt(p0x*p0x + p0y*p0y), sqrt(p1x*p1x + p1y*p1y)
        na0, na1 = atan2(p0y, p0x), atan2(p1y, p1x)
        nturn = sweep
        way = (nr0 + nr1)*0.5*sweep
        length = sqrt((narc ? way*way : no[1]*no[1] + no[2]*no[2]) + no[3]*no[3])
        rotation = max(abs(no[4]), abs(no[5]))*RADIUS
        length = max(length, rotation)
        ramp = kind == RAPID_MOVE ? RAPID_RAMP : CUT_RAMP
        ratio = max(length/(feed*ramp), 1)
        cycles = (1 + ratio)*(ramp*(1/Ts))
        whole = ftoi(cycles)            ; rounded up
        more = itof(whole) < cycles ? 1 : 0
        asked = periods
        Nc = asked == 0 ? whole + more : asked
        nN = place ? 0 : Nc
        nf = itof(Nc)
        nc1 = place ? 0 : min((1 + ratio)*pi/nf, pi)
        both = nf*((1 + ratio)*pi/nf)*2 - 2*pi
        .assume both >= 6
        nA = place ? 0 : 1/both
        exists = length > 0             ; a move of no length vanishes
        ready = exists | place
        .rep i, 1, 5
        end[i], nt[i] = to_{i}, to_{i}
        no[i] = place ? 0 : no[i]
        .endr
        nc[1], nc[2], nline = centre_1, centre_2, line
        taken = taken + 1
        pop = taken
; What is read after it may be the next block's.
.order  kind, pop
.order  line, pop
.order  sweep, pop
.order  feed, pop
.order  periods, pop
        .rep i, 1, 5
.order  to_{i}, pop
        .endr
        .rep i, 1, 2
.order  centre_{i}, pop
        .endr
prepared:

; ---- Begin it where the last one has ended ----------------------------------------------------------------------------------
.reg    runs:int unready:int stay:int
        runs = k != N
        unready = ready == 0
        stay = runs | unready
        bnz     stay, begun
        .rep i, 1, 5
        fh[i], fl[i], o[i] = th[i], tl[i], no[i]
        .endr
        .rep i, 1, 3
        words   th[i], tl[i], nt[i], um
        .endr
        .rep i, 4, 5
        words   th[i], tl[i], nt[i], ua
        .endr
        .rep i, 1, 2
        words   ch[i], cl[i], nc[i], um
        .endr
        k, N, c1, A = 0, nN, nc1, nA
        B = nA*nc1*(1/Ts)
        C = B*nc1*(1/Ts)
        r0, r1, a0, a1, turn, arc = nr0, nr1, na0, na1, nturn, narc
        now = nline
        ready = 0
begun:

; ---- The point --------------------------------------------------------------------------------------------------------------
; The second half is the first one's mirror image, from the end: s and the second derivative change sign.
.reg    left:int first:int m:int phase inner sn cs s f1 f2 ramps:int
        left = N - k
        first = k < left
        m = first ? k : left
        phase = itof(m)*c1
        .assume phase >= 0
        inner = min(phase, pi)
        ramps = phase < pi
        sn, cs = sin(inner), cos(inner)
        s = A*((inner - sn) + (phase - inner)*2)
        .assume s <= 0.5
        s = first ? s : -s
        f1 = B*(1 - cs)
        f2 = ramps ? C*sn : 0
        f2 = first ? f2 : -f2

; The way of every axis along a line; for Z and the table along an arc, too.
.reg    pos[5] vel[5] acc[5]
        .rep i, 1, 5
        pos[i] = (first ? fh[i] : th[i]) + ((first ? fl[i] : tl[i]) + o[i]*s)
        vel[i], acc[i] = o[i]*f1, o[i]*f2
        .endr
        z, vz, az = pos[3], vel[3], acc[3]
        alpha, omega_alpha, eps_alpha = pos[4], vel[4], acc[4]
        gamma, omega_gamma, eps_gamma = pos[5], vel[5], acc[5]

; An arc's X and Y: the radius goes linearly from the beginning's to the end's.
.reg    growth radius angle co si rt gt d1x d1y d2x d2y
        growth = r1 - r0
        radius = (first ? r0 : r1) + growth*s
        angle = (first ? a0 : a1) + turn*s
        angle = arc ? angle : 0         ; of a line it may be anything, and no sine
        co, si = cos(angle), sin(angle)
        rt, gt = radius*turn, growth*turn*2
        d1x, d1y = growth*co - rt*si, growth*si + rt*co
        d2x, d2y = -(gt*si) - rt*turn*co, gt*co - rt*turn*si
        x = arc ? ch[1] + (cl[1] + radius*co) : pos[1]
        y = arc ? ch[2] + (cl[2] + radius*si) : pos[2]
        vx = arc ? d1x*f1 : vel[1]
        vy = arc ? d1y*f1 : vel[2]
        ax = arc ? d2x*f1*f1 + d1x*f2 : acc[1]
        ay = arc ? d2y*f1*f1 + d1y*f2 : acc[2]

        block = now
        standing = k == N
        k = k + (k == N ? 0 : 1)
        wait    period

; For `takt accuracy`: blocks within 1 m of the origin and 5 turns, arcs of up to a turn, moves of 1 mm/s to 1 m/s and of up to an hour.
.range  empty, ready, arc, narc = 0, 1
.range  kind = PLACE, ARC
.range  line, now, nline = 0, 0x7fffffff
.range  taken = 0, 0x7ffffffe
        .rep i, 1, 3
.range  to_{i}, end[i], nt[i] = -1/um, 1/um
.range  fh[i], th[i] = -1, 1
.range  fl[i], tl[i] = 0, 255*um
.range  o[i], no[i] = -2, 2
        .endr
        .rep i, 4, 5
.range  to_{i}, end[i], nt[i] = -32/ua, 32/ua
.range  fh[i], th[i] = -32, 32
.range  fl[i], tl[i] = 0, 255*ua
.range  o[i], no[i] = -64, 64
        .endr
.range  centre_1, centre_2, nc = -1/um, 1/um
.range  ch = -1, 1
.range  cl = 0, 255*um
.range  r0, r1, nr0, nr1 = 0, 3
.range  a0, a1, na0, na1 = -pi, pi
.range  sweep, turn, nturn = -2*pi, 2*pi
.range  feed = 0.001, 1
.range  periods = 0, 36000000
.range  k, N, nN = 0, 400000000
.range  c1, nc1 = 0, pi
.range  A, nA = 0, 0.1667
.range  B = 0, 1e4
.range  C = 0, 2e8
; SPDX-License-Identifier: MIT OR Apache-2.0
