; machine f3
.input  i:int
.output y, z
.data
small:  .float 1, 2
large:  .space 1500
huge:   .space 6144
end:    .float 3
.period
period: ld      y, small[i]
        ld      z, end
        st      huge+3, y
        st      5000[zero], y
        wait    period
