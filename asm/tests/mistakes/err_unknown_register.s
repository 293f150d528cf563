.reg velocity torque
.period
        mov     velocity, 1
        fmul    torque, velocty, velocity
        fmul    torqe, velocity, velocity
        fadd    torque, missing, velocity
        fadd    other, velocity, velocity
        fadd    torque, m3, velocity
