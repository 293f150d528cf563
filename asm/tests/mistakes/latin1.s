; first line
.const X = 1 ; ä
