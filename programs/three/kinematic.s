; The kinematic core. docs/controller.md.
.include "packets.s"
.include "ums7.s"
.schedule on

; ---- Ports -------------------------------------------------------------------------------------------------------------------
.input  item:int, item_sequence:int, item_epoch:int, c1, c2, c3, c4, c5, c6, profile:int, how:int, amount, flags:int
.input  item_empty:int
.output item_pop:int
.input  epoch:int, stop_cause:int, stop_sequence:int, reset:int
.output reply:int, reply_sequence:int, reply_cause:int, reply_value, reply_epoch:int, reply_push:int
.input  m1, m2, m3, m4, m5, m6, ready:int, lost:int
.output point_q, point_v, point_a, point_u, point_i, point_push:int
.output q1, q2, q3, q4, q5, q6, x, y, z, roll, pitch, yaw, mode:int, segment:int, queued:int
.output beat:int
.state  q[6] beats:int pushes:int on:int
.once
        .rep i, 1, 6
        q[i] = 0
        q{i} = 0
        .endr
        beats, pushes, on = 0, 0, 0
        x, y, z, roll, pitch, yaw = 0, 0, 0, 0, 0, 0
        mode, segment, queued, beat = 0, 0, 0, 0
        item_pop, reply, reply_sequence, reply_cause, reply_value, reply_epoch, reply_push = 0, 0, 0, 0, 0, 0, 0
        wait period
.period
period: bz ready, done
        beats = beats + 1
        beat = beats
        bnz on, go
        .rep i, 1, 6
        q[i] = m{i}
        .endr
        on = 1
go:
        .rep i, 1, 6
        point_q, point_v, point_a, point_u, point_i = q[i], 0, 0, 0, 8/60
        pushes = pushes + 1
pushed{i}: point_push = pushes
        q{i} = q[i]
        .endr
        .reg all
        all = itof(item + item_sequence + item_epoch + item_empty + profile + how + flags + epoch + stop_cause + stop_sequence + reset + lost) + amount + c1+c2+c3+c4+c5+c6
done:   wait period
