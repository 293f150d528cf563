; machine t3
; Outputs that are written behind a `publish`, or published again, on some path to the `wait`.
.schedule on
.input  x, n:int
.output u, w, late
.reg    t
.once
        wait    period
.period
period: fmul    u, x, x
        fadd    w, x, x
        bz      n, other
        publish
        fmul    t, x, 2.0               ; this may follow
        fadd    late, t, x
        jmp     done
other:  call    ahead
        fadd    u, x, 1.0
        publish || fsub w, x, 1.0
done:   bnz     n, end
        publish
end:    wait    period
ahead:  publish
        ret
