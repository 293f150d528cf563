.loop_bound
.loop_bound 0
.loop_bound -1
.loop_bound 2.5
.loop_bound 2^32
.data
.loop_bound 3
.once
.loop_bound 3
.loop_bound 4
        nop
.loop_bund 3
        halt
.period
        nop
.loop_bound 5
