; The product of two 12×12 matrices.

.include <arrays.s>
.array  A[12,12] B[12,12] C[12,12]
.output done
.schedule on
.contract on
.once
        mov     done, zero
        wait    period
.period
period:
        array_matmul C, A, B, 12, 12, 12, 4
        done = 1
        wait    period

; For `takt accuracy`: data in units of their full scale.
.range  A, B = -1, 1
.result C
; SPDX-License-Identifier: MIT OR Apache-2.0
