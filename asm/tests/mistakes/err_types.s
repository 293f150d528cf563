.input a:integer, b:in
.output c:flot
.reg d:
.reg e @
.reg f:int @ i0 @ i1
