; The communication core: packets in, items for the kinematic core and reports out. docs/controller.md.
;
; A packet is read word by word, its checksum along with it. What is wrong with it stops the robot; what is right becomes an item in the
; kinematic core's queue, or an order that does not wait for its turn. What that core answers goes on to the host.

.include "packets.s"
.include "ums7.s"
.include <math.s>
.schedule on

.const  WORDS   = 64                    ; words read in a period at most
.const  ANSWERS = 8                     ; replies passed on in a period at most
.const  LATE    = 64                    ; periods without a word of a packet that has begun
.const  SILENCE = 313                   ; periods of 1.6 ms without a packet while the robot moves: 0.5 s
.const  LONGEST = 600                   ; s, of a motion
.const  HALTED  = 2                     ; of `halting`: it stands, as of the period before
.const  BEATS   = 2                     ; periods of the kinematic core at least, of four to one of this

; ---- Ports --------------------------------------------------------------------------------------------------------------------
.input  word:int, word_empty:int
.output word_pop:int
.output report:int, sequence:int, cause:int, value, report_push:int
.output item:int, item_sequence:int, item_epoch:int, c1:bits, c2:bits, c3:bits, c4:bits, c5:bits, c6:bits
.output profile:int, periods:int, ramp_periods:int, flags:int, item_push:int
.input  item_count:int                 ; entries of the queue, its depth at most
.output epoch:int                       ; counts stops: items of an earlier one are dropped
.output stop_cause:int, stop_sequence:int, reset:int
.input  reply:int, reply_sequence:int, reply_cause:int, reply_value:bits, reply_epoch:int, reply_empty:int
.output reply_pop:int
.input  mode:int, beat:int              ; of the kinematic core: what the robot does; counts its periods
.input  stand1, stand2, stand3, stand4, stand5, stand6 ; rad, its reference
.input  inputs:int, analogue1, analogue2
.output outputs:int, level1, level2
.output tracked:int, smooth1, smooth2   ; inputs as they are tracked: bits that stood for two periods, analogue values smoothed

; ---- State --------------------------------------------------------------------------------------------------------------------
.state  got:int need:int kind:int crc:bits idle:int ; of the packet that is read: words, and how many they will be
.state  planning:int                    ; it is a motion, to be planned
.state  jog_kind:int                    ; rates of the jog that goes on
.state  number:bits last:int            ; its sequence number; the last good one's
.state  silence:int pending:int motions:int locked:int started:int jogging:int halting:int ; motions and outputs in the queue, motions of them; …; until the kinematic core says
.state  now:int resets:int              ; stops and resets so far
.state  ready_number:int                ; of a reset that is to be answered
.state  beats:int                       ; where the beat stood
.state  raw:int                         ; inputs a period ago
.state  tool[3]                         ; m
.state  via_before:int                  ; the motion before is to be passed
.state  pops:int pushes:int reports:int taken:int ; written to ports that want only a write

.data
lengths: .word  0, 10, 10, 7, 0, 2, 2, 0, 3, 12 ; of the payload, by kind
crc_table:                              ; of four bits at a time, reflected polynomial
        .rep    i, 0, 15
.const  b{i}_0 = i
        .rep    j, 0, 3
.const  b{i}_{j+1} = b{i}_{j} % 2 == 1 ? xor(b{i}_{j} >> 1, 0xedb88320) : b{i}_{j} >> 1
        .endr
        .word   b{i}_4
        .endr
payload:                                ; of the packet that is read
        .space  PAYLOAD_WORDS + 1
        .macro  floats count
        .rep    i, 1, count
        .float  0
        .endr
        .endm
; Six words each, of the joints: as in kinematic.s.
way:        floats 6
way1:       floats 6
joints:     floats 6
joints1:    floats 6
forces1:    floats 6
weights:    floats 6
plan_S:     floats 6                    ; of what is planned: where it begins, its way, where it ends
plan_D:     floats 6
plan_T:     floats 6
forces0:    floats 6                    ; forces1 of the sample before
planned:    floats 6                    ; where what has been planned ends: joints, pose
planned_pose: floats 6
fastest:    .float fast1, fast2, fast3, fast4, fast5, fast6 ; limits as they are, and as they are built in
strongest:  .float torque1, torque2, torque3, torque4, torque5, torque6
fastest0:   .float fast1, fast2, fast3, fast4, fast5, fast6
strongest0: .float torque1, torque2, torque3, torque4, torque5, torque6
lowest:     .float low1, low2, low3, low4, low5, low6
highest:    .float high1, high2, high3, high4, high5, high6

.once
        got, need, kind, idle, planning = 0, 0, 0, 0, 0
        li      crc, 0xffffffff
        number, last, jog_kind = 0, 0, 0
        silence, pending, motions, locked, started, jogging, halting = 0, 0, 0, 0, 0, 0, 0
        via_before, space, back, elbow_up, wrist_up = 0, 0, 0, 0, 0
        tool[1], tool[2], tool[3] = 0, 0, 0
        now, resets, beats, raw, ready_number = 0, 0, 0, 0, 0
        pops, pushes, reports, taken = 0, 0, 0, 0
        epoch, stop_cause, stop_sequence, reset = 0, 0, 0, 0
        outputs, level1, level2 = 0, 0, 0
        tracked, smooth1, smooth2 = 0, 0, 0
        wait    period

.period
period:
.reg    rk:int rs:int rc:int rw:bits    ; a report
.reg    error:int
        silence = silence + 1

; ---- Signals ------------------------------------------------------------------------------------------------------------------
.reg    bits:int same:int
        bits = inputs
        same = xor(xor(bits, raw), 0xffffffff)
        tracked = (bits & same) | (tracked & xor(same, 0xffffffff))
        raw = bits
        smooth1 = smooth1 + (analogue1 - smooth1)*0.25
        smooth2 = smooth2 + (analogue2 - smooth2)*0.25

; ---- After power-up ---------------------------------------------------------------------------------------------------------------
.reg    wake:int here:int
        here = beat
        wake = started | (here < BEATS)
        bnz     wake, awake
        started = 1
        rk, rs, rc, rw = REPORT_READY, 0, 0, 0
        beats = here - BEATS
        call    say
awake:
; The kinematic core has said that it stands after a stop: what is known of it here is from then, too.
.reg    stands:int
        stands = halting == HALTED
        bz      stands, not_halted
        halting = 0
        bz      ready_number, not_halted
        mov     rs, ready_number
        mov     ready_number, zero
        rk, rc, rw = REPORT_READY, 0, 0
        call    say
not_halted:

; ---- The kinematic core must have had its periods -----------------------------------------------------------------------------------
.reg    behind:int
        behind = started & (here - beats < BEATS)
        behind = behind & !locked
        beats = here
        bz      behind, alive
        li      error, CAUSE_DEADLINE
        mov     rs, zero
        call    stop_for
alive:

; ---- Words ----------------------------------------------------------------------------------------------------------------------
.reg    left:int w:bits x:bits before:bits
        idle = idle + 1
        li      left, WORDS
        .loop_bound WORDS + 1
next_word:
.reg    none:int
        none = word_empty | (left == 0)
        bnz     none, words_end
        mov     w, word
        left = left - 1
taken_word:                             ; the word has been read: now it may go
        pops = pops + 1
        word_pop = pops
        mov     idle, zero
        mov     before, crc
        ixor    x, crc, w
        .rep    i, 1, 8
.reg    x{i}:bits y{i}:bits t{i}:bits
        iand    x{i}, x, 15
        ld      t{i}, crc_table[x{i}]
        ishr    y{i}, x, 4
        ixor    x, y{i}, t{i}
        .endr
        mov     crc, x
.reg    first:int second:int
        first = got == 0
        second = got == 1
        bnz     first, header
        bnz     second, numbered
.reg    ending:int
        ending = got == need - 1
        bnz     ending, ended
        st      payload - 2[got], w
        got = got + 1
        jmp     next_word

header:
.reg    magic:int k:int n:int rest:int known:int length:int ok:int safe:int
        ishr    magic, w, 24
        ishr    k, w, 16
        iand    k, k, 255
        iand    n, w, 255
        iand    rest, w, 0xff00
        iltu    known, k, KINDS
        safe = known ? k : 0
        ld      length, lengths[safe]
        ok = (magic == MAGIC) & known & (rest == 0) & (n == length)
        kind = safe
        need = n + 3
        got = 1
        bnz     ok, next_word
        call    clear
        li      error, CAUSE_HEADER
        mov     rs, zero
        call    stop_for
        jmp     next_word

numbered:
        mov     number, w
        got = 2
        jmp     next_word

ended:
.reg    sum:bits right:int
        ixor    sum, before, 0xffffffff
        ieq     right, sum, w
        call    clear
        bnz     right, packet
        li      error, CAUSE_CRC
        mov     rs, number
        call    stop_for
        jmp     next_word

; ---- A whole packet -------------------------------------------------------------------------------------------------------------
packet:
.reg    is:int expected:int follows:int refuse:int
        mov     silence, zero
        is = kind == KIND_RESET
        bnz     is, resetting
        iadd    expected, last, 1
        ieq     follows, expected, number
        bnz     follows, in_order
        li      error, CAUSE_SEQUENCE
        mov     rs, number
        call    stop_for
        jmp     next_word
in_order:
        mov     last, number
        bz      kind, next_word         ; NOP
        mov     rs, number
        mov     rw, zero
        li      rk, REPORT_REFUSED
        li      rc, CAUSE_STOPPEDSTATE
        bnz     locked, refused
        is = kind == KIND_STOP
        bnz     is, stopping
; Room in the queue: two items for limits, none for a motion that is only checked.
.reg    moves:int jogs:int sets:int only:int needs:int crowded:int
        moves = (kind == KIND_MOVE) | (kind == KIND_MOVEL)
        ld      only, payload + 9       ; a motion's flags
        only = moves & ((only & FLAG_CHECK) != 0)
        needs = kind == KIND_LIMITS ? 2 : only ? 0 : 1
        crowded = item_count + needs > QUEUE
        li      rc, CAUSE_QUEUEFULL
        bnz     crowded, refused
        .rep    i, 1, 6
        ld      c{i}, payload + i - 1
        .endr
        jogs = kind == KIND_JOG
        sets = (kind == KIND_OUTPUT) | (kind == KIND_LEVEL)
        bnz     moves, motion
        bnz     jogs, jog
        bnz     sets, set
        is = kind == KIND_TOOL
        bnz     is, tool_packet

; LIMITS: velocities and torques, lower than those built in and more than nothing. Two items.
.reg    j:int jn:int ju:int limit:float built:float less:int wrong_one:int
.macro  each_joint label                ; ends a loop over the joints, j from 0
        j = j + 1
        jn = j < 6
        bnz     jn, label
.endm
        mov     wrong_one, zero
        j = 0
        .loop_bound 12
limits: ld      limit, payload[j]
        ld      built, fastest0[j]
        less = (limit > 0) & (limit <= built)
        j = j + 1
        wrong_one = less | wrong_one ? wrong_one : j
        jn = j < 12
        bnz     jn, limits
        jn = wrong_one > 6
        rc = jn ? CAUSE_TORQUELIMIT : CAUSE_VELOCITYLIMIT
        wrong_one = jn ? wrong_one - 6 : wrong_one
        li      refuse, PAYLOAD_WORDS
.reg    wrong_value
        wrong_value = itof(wrong_one)
        mov     rw, wrong_value
        bnz     wrong_one, refused
        j = 0
        .loop_bound 12
limit_it:
        ld      limit, payload[j]
        st      fastest[j], limit
        j = j + 1
        jn = j < 12
        bnz     jn, limit_it
        li      rk, KIND_LIMITS
        call    put
        .rep    i, 1, 6
        ld      c{i}, payload + 5 + i
        .endr
        li      rk, KIND_TORQUES
        call    put
        jmp     accepted

tool_packet:
        li      refuse, 3
        call    finite
        bnz     refuse, refused
        li      rc, CAUSE_NOTWHILEMOVING
        is = pending | jogging | halting | (mode != MODE_STANDING)
        bnz     is, refused
.reg    tx:float ty:float tz:float
        ld      tx, payload
        ld      ty, payload + 1
        ld      tz, payload + 2
        tool[1], tool[2], tool[3] = tx, ty, tz
        mov     rk, kind
        call    put
accepted:
        li      rk, REPORT_ACCEPTED
        mov     rc, zero
        mov     rw, zero
        call    say
        jmp     next_word

jog:    li      refuse, 7
        call    finite
        bnz     refuse, refused
.reg    which:int which_ok:int idle_or_jog:int
        ld      which, payload
        iltu    which_ok, which, JOGS
        li      rc, CAUSE_HEADER
        bz      which_ok, refused
        li      rc, CAUSE_NOTWHILEMOVING
        idle_or_jog = (mode == MODE_STANDING) | (mode == MODE_JOGGING)
        is = pending | halting | !idle_or_jog
        bnz     is, refused
        is = (jogging != 0) & (which != jog_kind) ; one kind of rates ends before another begins
        bnz     is, refused
        .rep    i, 1, 6
        ld      c{i}, payload + i
        .endr
        mov     profile, which
        mov     jog_kind, which
        jogging = last
        mov     rk, kind
        call    put
        jmp     accepted

set:    pending = pending + 1
        mov     rk, kind
        call    put
        jmp     next_word

; MOVE, MOVEL: targets finite or NaN, which stands for "as it is"; profile, what is demanded, how much, flags.
motion:
.reg    infinite:int pr:int ho:int am:float fl:int good:int positive:int
        mov     infinite, zero
        .rep    i, 0, 5
.reg    tb{i}:bits ti{i}:int
        ld      tb{i}, payload + i
        iand    tb{i}, tb{i}, 0x7fffffff
        ieq     ti{i}, tb{i}, bits(inf)
        ior     infinite, infinite, ti{i}
        .endr
        ld      pr, payload + 6
        ld      ho, payload + 7
        ld      am, payload + 8
        ld      fl, payload + 9
.reg    pr_ok:int ho_ok:int fl_ok:int
        iltu    pr_ok, pr, PROFILES
        iltu    ho_ok, ho, HOWS
        iltu    fl_ok, fl, FLAGS + 1
        good = pr_ok & ho_ok & fl_ok
        positive = ho == HOW_FAST ? 1 : (am > 0) & (am <= LONGEST)
        li      rc, CAUSE_HEADER
        bz      good, refused
        li      rc, CAUSE_NOTFINITE
        bnz     infinite, refused
        bz      positive, refused
; It goes on where the motion before ends; without one, the robot must stand.
        li      rc, CAUSE_NOTWHILEMOVING
        is = jogging | halting | (!motions & (mode != MODE_STANDING))
        bnz     is, refused
        planning = 1                    ; the words that follow are for the next period
        mov     left, zero
        jmp     next_word

refused:
        li      rk, REPORT_REFUSED
        call    say
        jmp     next_word

stopping:
        call    drop
        mov     stop_cause, zero
        mov     stop_sequence, rs
        jmp     next_word

resetting:
        mov     last, number
        mov     locked, zero
        call    drop
        mov     stop_cause, zero
        mov     stop_sequence, zero
        resets = resets + 1
        mov     reset, resets
        mov     ready_number, number
        jmp     next_word
words_end:
        bz      planning, no_plan
        planning = 0
        bnz     motions, plan_motion
; No motion is going on: the way begins where the robot stands.
        mov     via_before, zero
        .rep    i, 1, 6
        st      planned + i - 1, stand{i}
        st      way + i - 1, stand{i}
        .endr
        call    fetch
        call    frame
        call    forward
        .rep    i, 1, 6
        st      planned_pose + i - 1, fk[i]
        .endr
.include "planning.s"
no_plan:

; ---- A packet that was begun and does not go on; a host that is silent while the robot moves ------------------------------------------
.reg    begun:int overdue:int
        begun = got != 0
        overdue = begun & (idle >= LATE)
        bz      overdue, in_time
        call    clear
        li      error, CAUSE_LATE
        mov     rs, zero
        call    stop_for
in_time:
.reg    busy:int quiet:int
        busy = (mode == MODE_MOVING) | (mode == MODE_JOGGING)
        quiet = busy & (silence > SILENCE)
        bz      quiet, heard
        li      error, CAUSE_SILENT
        mov     rs, zero
        call    stop_for
heard:

; ---- Replies of the kinematic core --------------------------------------------------------------------------------------------------
.reg    answers:int r:int
        li      answers, ANSWERS
        .loop_bound ANSWERS + 1
next_reply:
        none = reply_empty | (answers == 0)
        bnz     none, replies_end
.reg    re:int halts:int jogged:int done:int locks:int current:int sets_now:int
        answers = answers - 1
        r = reply
        rs = reply_sequence
        rc = reply_cause
        mov     rw, reply_value
        re = reply_epoch
taken_reply:
        taken = taken + 1
        reply_pop = taken
        current = re == now
        done = r & REPLY_DONE
        done = current & (done != 0)
        sets_now = r & REPLY_SET
        pending = pending - done
        done = done & (sets_now == 0)
        motions = motions - done
        jogged = r & REPLY_JOGGED
        jogging = (jogged != 0) & (rs == jogging) ? 0 : jogging
        halts = r & REPLY_HALTED
        halting = (halts != 0) & current ? HALTED : halting
        locks = r & REPLY_LOCK
        iand    rk, r, 0xff
        bnz     sets_now, setting
        bz      locks, unlocked
        bnz     locked, unlocked
        locked = 1
        call    drop
        mov     stop_cause, rc
        mov     stop_sequence, zero
unlocked:
        bz      rk, next_reply_soon
        call    say
        jmp     next_reply_soon

; An output or a level whose turn it is.
setting:
        mov     rwi, rw
.reg    rwi:int level:int a:int to1:int to2:int lv:bits
        bz      current, next_reply_soon
        level = rk == KIND_LEVEL
        a = outputs
        a = (a & xor(rc, 0xffffffff)) | (rc & rwi)
        outputs = level ? outputs : a
        to1 = level & (rc == 1)
        to2 = level & (rc == 2)
        mov     lv, rw
        sel     level1, to1, lv:float, level1
        sel     level2, to2, lv:float, level2
        rk, rc, rw = REPORT_FINISHED, 0, 0
        call    say
next_reply_soon:                        ; jumps enough since the pop: the next head is on the ports
        jmp     next_reply
replies_end:
        wait    period

; ---- Subroutines --------------------------------------------------------------------------------------------------------------------
; A report to the host.
say:    report = rk
        sequence = rs
        cause = rc
        mov     value, rw:float
        reports = reports + 1
        report_push = reports
        .order  report, sequence, cause, value, report_push
        ret

; Stops the robot for an error, unless it stands after one already, and says so: `error`, `rs`.
stop_for:
        bnz     locked, known_error
        locked = 1
        call    drop
        mov     stop_cause, error
        mov     stop_sequence, zero
        rk, rc, rw = REPORT_STOPPED, error, 0
        call    say
known_error:
        ret

; Nothing in the queue counts any more.
drop:   now = now + 1
        pending, motions, jogging = 0, 0, 0
        li      halting, 1
        mov     epoch, now
        ret

; The next word begins a packet.
clear:  mov     got, zero
        li      crc, 0xffffffff
        ret

; An item for the kinematic core: `rk`; its values are on their ports.
put:    item = rk
        mov     item_sequence, last
        mov     item_epoch, now
        pushes = pushes + 1
        item_push = pushes
        .order  item, item_sequence, item_epoch, item_push
        ret

; Whether the first `refuse` words of the payload are finite: then `refuse` becomes 0, else `rc` is the cause.
finite:
.reg    at:int fb:bits bad:int wrong:int
        mov     at, zero
        mov     bad, zero
        .loop_bound PAYLOAD_WORDS
scan:   ld      fb, payload[at]
        iand    fb, fb, 0x7fffffff
        ilt     wrong, bits(3.4028234663852886e38), fb
        ior     bad, bad, wrong
        at = at + 1
        wrong = at < refuse
        bnz     wrong, scan
        mov     refuse, bad
        li      rc, CAUSE_NOTFINITE
        ret

.include "geometry.s"
; SPDX-License-Identifier: MIT OR Apache-2.0
