.rep i, 0, 2
.reg a{i-1}
.endr
.reg b{0.5}
.reg {7}
.reg c{1/0}
.reg d{e}
