.data
gains:  .float 1, 2
.reg a
.once
        ld      a, gains
        st      gain[zero], a
        jmp     perid
.period
period: wait    period
        jmp     gains
        jmp     a
        jmp     nowhere
