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
.loop_bound 3 totl 9
        nop
.loop_bound 3 total 0
        nop
.loop_bound 3 total
        nop
.loop_bound 3 total 9 9
        nop
        halt
.period
        nop
.loop_bound 5
