; inverse-dynamics of panda: joint forces that a motion takes
; operations: 539 (sums 261, products 266, divisions and roots 0, trigonometric 12, others 0)
; passed over: `limit`
; frames: z along the joint's axis; of each link: its joint, and where its frame lies in the one before
; link 1: panda_joint1, on panda_link0: origin 0 0 0.333 m, axis 0 0 1
; link 2: panda_joint2, on link 1: origin 0 0 0 m, axis 0 -1 0
; link 3: panda_joint3, on link 2: origin 0 0 0 m, axis 0 -1 0
; link 4: panda_joint4, on link 3: origin 0.0825 0 0.316 m, axis 0 -1 0
; link 5: panda_joint5, on link 4: origin 0.0825 -0.384 0 m, axis 0 -1 0
; link 6: panda_joint6, on link 5: origin 0 0 0 m, axis 0 -1 0
; link 7: panda_joint7, on link 6: origin 0 -0.088 0 m, axis -1 0 0
; unit of length: 0.082500 m
; A body: a law sets the inputs, includes it in `.period`, and reads the outputs.

; Inputs, to be set before.
.reg    id_q[7]
;       id_q[1]: position of panda_joint1, rad (no effect)
;       id_q[2]: position of panda_joint2, rad
;       id_q[3]: position of panda_joint3, rad
;       id_q[4]: position of panda_joint4, rad
;       id_q[5]: position of panda_joint5, rad
;       id_q[6]: position of panda_joint6, rad
;       id_q[7]: position of panda_joint7, rad
.reg    id_qd[7]
;       id_qd[1]: velocity of panda_joint1, rad/s
;       id_qd[2]: velocity of panda_joint2, rad/s
;       id_qd[3]: velocity of panda_joint3, rad/s
;       id_qd[4]: velocity of panda_joint4, rad/s
;       id_qd[5]: velocity of panda_joint5, rad/s
;       id_qd[6]: velocity of panda_joint6, rad/s
;       id_qd[7]: velocity of panda_joint7, rad/s
.reg    id_qdd[7]
;       id_qdd[1]: acceleration of panda_joint1, rad/s²
;       id_qdd[2]: acceleration of panda_joint2, rad/s²
;       id_qdd[3]: acceleration of panda_joint3, rad/s²
;       id_qdd[4]: acceleration of panda_joint4, rad/s²
;       id_qdd[5]: acceleration of panda_joint5, rad/s²
;       id_qdd[6]: acceleration of panda_joint6, rad/s²
;       id_qdd[7]: acceleration of panda_joint7, rad/s²
; Outputs.
.reg    id_tau[7]
;       id_tau[1]: force of panda_joint1, N m
;       id_tau[2]: force of panda_joint2, N m
;       id_tau[3]: force of panda_joint3, N m
;       id_tau[4]: force of panda_joint4, N m
;       id_tau[5]: force of panda_joint5, N m
;       id_tau[6]: force of panda_joint6, N m
;       id_tau[7]: force of panda_joint7, N m
.reg    id_s2 id_c2 id_s3 id_c3 id_s4 id_c4 id_s5 id_c5 id_s6 id_c6 id_t1 id_s7 id_c7 id_u1xx_neg
.reg    id_w2x_neg id_w2y_neg id_u2xz_neg id_u2yz id_u2zy_neg id_t2 id_t3 id_u2zx_neg id_t4 id_u2xy_neg
.reg    id_u2yx id_t5 id_t6 id_t7 id_u2xx_neg id_u2yy_neg id_a2x_neg id_a2y_neg id_w3x id_w3y id_w3z
.reg    id_u3xz id_u3yz_neg id_t8 id_u3zy id_t9 id_t10 id_u3zx id_t11 id_u3xy_neg id_u3yx id_t12 id_t13
.reg    id_t14 id_u3xx_neg id_u3yy_neg id_a3x_neg id_a3y id_t15 id_a4z id_t16 id_w4x_neg id_w4y id_w4z
.reg    id_u4xz id_u4yz id_t17 id_u4zy_neg id_t18 id_t19 id_u4zx_neg id_t20 id_u4xy_neg id_u4yx id_t21
.reg    id_t22 id_t23 id_u4xx_neg id_u4yy_neg id_a4x_neg id_a4y id_t24 id_a5z_neg id_t25 id_w5x_neg
.reg    id_w5y_neg id_w5z id_u5xz_neg id_u5yz id_t26 id_u5zy_neg id_t27 id_t28 id_u5zx_neg id_t29
.reg    id_u5xy_neg id_u5yx id_t30 id_t31 id_t32 id_u5xx_neg id_u5yy_neg id_a5x_neg id_a5y_neg id_w6x
.reg    id_w6y id_w6z id_u6xz id_u6yz_neg id_t33 id_t34 id_t35 id_u6zy id_u6zx_neg id_t36 id_u6xy_neg
.reg    id_u6yx id_t37 id_t38 id_t39 id_u6xx_neg id_u6yy_neg id_a6x_neg id_a6y id_a7z id_w7x_neg id_w7y
.reg    id_w7z id_u7xz id_u7yz id_t40 id_t41 id_u7zy_neg id_u7zx_neg id_t42 id_u7xy_neg id_u7yx id_t43
.reg    id_t44 id_t45 id_u7xx_neg id_a7y id_f7x_neg id_f7y id_f7z_neg id_n7x_neg id_n7y id_t46 id_t47
.reg    id_f6x id_f6y id_t48 id_n6x_neg id_t49 id_n6y id_t50 id_t51 id_f5x_neg id_f5y id_f5z_neg id_t52
.reg    id_n5x_neg id_t53 id_n5y_neg id_t54 id_t55 id_t56 id_f4x id_f4y id_f4z_neg id_t57 id_n4x id_t58
.reg    id_n4y_neg id_t59 id_t60 id_t61 id_n3x_neg id_t62 id_n3y id_t63 id_t64 id_n2x_neg id_t65 id_n2y_neg
.reg    id_t66

        id_s2 = sin(id_q[2])
        id_c2 = cos(id_q[2])
        id_s3 = sin(id_q[3])
        id_c3 = cos(id_q[3])
        id_s4 = sin(id_q[4])
        id_c4 = cos(id_q[4])
        id_s5 = sin(id_q[5])
        id_c5 = cos(id_q[5])
        id_s6 = sin(id_q[6])
        id_c6 = cos(id_q[6])
        id_t1 = id_q[7] + 0.668922530630159
        id_s7 = sin(id_t1)
        id_c7 = cos(id_t1)
        id_u1xx_neg = id_qd[1]*id_qd[1]                      ; acceleration of points of link 1 relative to its origin, 1/s²
        id_w2x_neg = id_qd[1]*id_s2                          ; angular velocity of link 2, in its frame, rad/s
        id_w2y_neg = id_qd[1]*id_c2
        id_u2xz_neg = id_qdd[1]*id_c2                        ; acceleration of points of link 2 relative to its origin, 1/s²
        id_u2yz = id_qdd[1]*id_s2
        id_u2zy_neg = id_u2yz + id_w2y_neg*(id_qd[2] + id_qd[2])
        id_t2 = id_qd[2]*id_w2x_neg
        id_t3 = id_u2xz_neg - id_t2
        id_u2zx_neg = id_t2 - id_t3
        id_t4 = id_w2x_neg*id_w2y_neg
        id_u2xy_neg = id_qdd[2] - id_t4
        id_u2yx = id_qdd[2] + id_t4
        id_t5 = id_w2y_neg*id_w2y_neg
        id_t6 = id_qd[2]*id_qd[2]
        id_t7 = id_t5 - id_t6
        id_u2xx_neg = id_t5 + id_t6
        id_u2yy_neg = id_u1xx_neg - id_t7
        id_a2x_neg = 118.909090909091*id_s2                  ; acceleration of the origin of link 2, less that of free fall
        id_a2y_neg = 118.909090909091*id_c2
        id_w3x = id_qd[2]*id_s3 - id_c3*id_w2x_neg           ; angular velocity of link 3, in its frame, rad/s
        id_w3y = id_s3*id_w2x_neg + id_qd[2]*id_c3
        id_w3z = id_qd[3] + id_w2y_neg
        id_u3xz = id_s3*id_u2zy_neg + id_c3*id_u2xy_neg      ; acceleration of points of link 3 relative to its origin, 1/s²
        id_u3yz_neg = id_s3*id_u2xy_neg - id_c3*id_u2zy_neg
        id_t8 = id_qdd[3] + id_t3
        id_u3zy = id_u3yz_neg + id_w3y*(id_w3z + id_w3z)
        id_t9 = id_w3x*id_w3z
        id_t10 = id_u3xz - id_t9
        id_u3zx = id_t9 - id_t10
        id_t11 = id_w3x*id_w3y
        id_u3xy_neg = id_t8 - id_t11
        id_u3yx = id_t8 + id_t11
        id_t12 = id_w3y*id_w3y
        id_t13 = id_w3z*id_w3z
        id_t14 = id_t12 - id_t13
        id_u3xx_neg = id_t12 + id_t13
        id_u3yy_neg = id_u2yy_neg - id_t14
        id_a3x_neg = id_c3*id_a2x_neg                        ; acceleration of the origin of link 3, less that of free fall
        id_a3y = id_s3*id_a2x_neg
        id_t15 = 3.83030303030303*id_u3xz - (id_u3xx_neg + id_a3x_neg)
        id_a4z = 3.83030303030303*id_u3yz_neg - (id_u3yx + id_a3y) ; acceleration of the origin of link 4, less that of free fall
        id_t16 = id_u3zx + (id_a2y_neg - 3.83030303030303*id_u2yy_neg)
        id_w4x_neg = id_s4*id_w3z + id_c4*id_w3x             ; angular velocity of link 4, in its frame, rad/s
        id_w4y = id_s4*id_w3x - id_c4*id_w3z
        id_w4z = id_qd[4] - id_w3y
        id_u4xz = id_s4*id_u3zy - id_c4*id_u3xy_neg          ; acceleration of points of link 4 relative to its origin, 1/s²
        id_u4yz = id_s4*id_u3xy_neg + id_c4*id_u3zy
        id_t17 = id_qdd[4] - id_t10
        id_u4zy_neg = id_u4yz - id_w4y*(id_w4z + id_w4z)
        id_t18 = id_w4x_neg*id_w4z
        id_t19 = id_u4xz + id_t18
        id_u4zx_neg = id_t18 + id_t19
        id_t20 = id_w4x_neg*id_w4y
        id_u4xy_neg = id_t17 + id_t20
        id_u4yx = id_t17 - id_t20
        id_t21 = id_w4y*id_w4y
        id_t22 = id_w4z*id_w4z
        id_t23 = id_t21 - id_t22
        id_u4xx_neg = id_t21 + id_t22
        id_u4yy_neg = id_u3yy_neg - id_t23
        id_a4x_neg = id_s4*id_t16 + id_c4*id_t15             ; acceleration of the origin of link 4, less that of free fall
        id_a4y = id_s4*id_t15 - id_c4*id_t16
        id_t24 = id_a4x_neg + (id_u4xx_neg - 4.65454545454545*id_u4xy_neg)
        id_a5z_neg = id_a4y + (id_u4yx + 4.65454545454545*id_u4yy_neg) ; acceleration of the origin of link 5, less that of free fall
        id_t25 = 4.65454545454545*id_u4zy_neg + (id_a4z - id_u4zx_neg)
        id_w5x_neg = id_s5*id_w4z - id_c5*id_w4x_neg         ; angular velocity of link 5, in its frame, rad/s
        id_w5y_neg = id_s5*id_w4x_neg + id_c5*id_w4z
        id_w5z = id_qd[5] - id_w4y
        id_u5xz_neg = id_s5*id_u4zy_neg + id_c5*id_u4xy_neg  ; acceleration of points of link 5 relative to its origin, 1/s²
        id_u5yz = id_s5*id_u4xy_neg - id_c5*id_u4zy_neg
        id_t26 = id_qdd[5] - id_t19
        id_u5zy_neg = id_u5yz + id_w5y_neg*(id_w5z + id_w5z)
        id_t27 = id_w5x_neg*id_w5z
        id_t28 = id_u5xz_neg - id_t27
        id_u5zx_neg = id_t27 - id_t28
        id_t29 = id_w5x_neg*id_w5y_neg
        id_u5xy_neg = id_t26 - id_t29
        id_u5yx = id_t26 + id_t29
        id_t30 = id_w5y_neg*id_w5y_neg
        id_t31 = id_w5z*id_w5z
        id_t32 = id_t30 - id_t31
        id_u5xx_neg = id_t30 + id_t31
        id_u5yy_neg = id_u4yy_neg - id_t32
        id_a5x_neg = id_s5*id_t25 - id_c5*id_t24             ; acceleration of the origin of link 5, less that of free fall
        id_a5y_neg = id_s5*id_t24 + id_c5*id_t25
        id_w6x = id_c6*id_w5z + id_s6*id_w5x_neg             ; angular velocity of link 6, in its frame, rad/s
        id_w6y = id_c6*id_w5x_neg - id_s6*id_w5z
        id_w6z = id_qd[6] + id_w5y_neg
        id_u6xz = id_c6*id_u5zy_neg - id_s6*id_u5xy_neg      ; acceleration of points of link 6 relative to its origin, 1/s²
        id_u6yz_neg = id_c6*id_u5xy_neg + id_s6*id_u5zy_neg
        id_t33 = id_qdd[6] + id_t28
        id_t34 = id_w6y*id_w6z
        id_t35 = id_u6yz_neg + id_t34
        id_u6zy = id_t34 + id_t35
        id_u6zx_neg = id_u6xz - id_w6x*(id_w6z + id_w6z)
        id_t36 = id_w6x*id_w6y
        id_u6xy_neg = id_t33 - id_t36
        id_u6yx = id_t33 + id_t36
        id_t37 = id_w6y*id_w6y
        id_t38 = id_w6z*id_w6z
        id_t39 = id_t37 - id_t38
        id_u6xx_neg = id_t37 + id_t38
        id_u6yy_neg = id_u5yy_neg - id_t39
        id_a6x_neg = id_c6*id_a5z_neg - id_s6*id_a5x_neg     ; acceleration of the origin of link 6, less that of free fall
        id_a6y = id_c6*id_a5x_neg + id_s6*id_a5z_neg
        id_a7z = id_a6x_neg - 1.06666666666667*id_u6xy_neg   ; acceleration of the origin of link 7, less that of free fall
        id_w7x_neg = id_c7*id_w6y - id_s7*id_w6z             ; angular velocity of link 7, in its frame, rad/s
        id_w7y = id_c7*id_w6z + id_s7*id_w6y
        id_w7z = id_qd[7] - id_w6x
        id_u7xz = id_c7*id_u6yx + id_s7*id_u6zx_neg          ; acceleration of points of link 7 relative to its origin, 1/s²
        id_u7yz = id_c7*id_u6zx_neg - id_s7*id_u6yx
        id_t40 = id_qdd[7] - id_t35
        id_t41 = id_w7z + id_w7z
        id_u7zy_neg = id_u7yz - id_w7y*id_t41
        id_u7zx_neg = id_u7xz + id_w7x_neg*id_t41
        id_t42 = id_w7x_neg*id_w7y
        id_u7xy_neg = id_t40 + id_t42
        id_u7yx = id_t40 - id_t42
        id_t43 = id_w7y*id_w7y
        id_t44 = id_w7z*id_w7z
        id_t45 = id_t43 - id_t44
        id_u7xx_neg = id_t43 + id_t44
        id_a7y = id_c7*(id_a5y_neg - 1.06666666666667*id_u6zy) + id_s7*(id_a6y + 1.06666666666667*id_u6yy_neg) ; acceleration of the origin of link 7, less that of free fall
        id_f7x_neg = 0.000270650181414799*id_u7xx_neg        ; force of link 7 and all behind it, in its frame
        id_f7y = 0.000270650181414799*id_u7yx
        id_f7z_neg = 0.000270650181414799*id_u7zx_neg
        id_n7x_neg = 0.000386330894443771*id_t45 + 0.00153588237201731*id_u7yx + (0.00400158305191131*id_u7zy_neg + 0.00108742353014813*id_u7zx_neg) ; moment of link 7 and all behind it, in its frame
        id_n7y = 0.00268106891544964*id_u7zx_neg - 0.000270650181414799*id_a7z + (0.00108742353014813*id_u7zy_neg + (0.00153588237201731*(id_u6xx_neg - id_u7xx_neg) - 0.000386330894443771*id_u7xy_neg))
        id_t46 = 0.00400158305191131*id_u7xy_neg + 0.00153588237201731*id_u7yz - (0.000386330894443771*id_u7xz - (0.00268106891544964*id_u7yx + 0.00108742353014813*(id_u7xx_neg - (id_u6xx_neg - id_t45))))
        id_tau[7] = 0.000270650181414799*id_a7y + id_t46
        id_t47 = id_s7*id_f7x_neg - id_c7*id_f7y
        id_f6x = id_f7z_neg + (0.0139295232094425*id_u6xx_neg + 0.0189096230973375*id_u6xy_neg) ; force of link 6 and all behind it, in its frame
        id_f6y = id_s7*id_f7y + (id_c7*id_f7x_neg - (0.0139295232094425*id_u6yx - 0.0189096230973375*id_u6yy_neg))
        id_t48 = 0.0143119143826753*id_u6zx_neg + 0.0189096230973375*id_a5y_neg - (0.0212899353705876*id_u6zy + (0.000103758917218685*id_t39 + 9.3569097314605e-5*id_u6yx))
        id_n6x_neg = id_tau[7] - (1.06666666666667*id_t47 - id_t48) ; moment of link 6 and all behind it, in its frame
        id_t49 = 0.0281097077456599*id_u6zx_neg + 0.0139295232094425*id_a5y_neg - (0.0143119143826753*id_u6zy + (9.3569097314605e-5*(id_u5yy_neg - id_u6xx_neg) - 0.000103758917218685*id_u6xy_neg))
        id_n6y = id_s7*id_n7y + (id_c7*id_n7x_neg + id_t49)
        id_t50 = 0.0189096230973375*id_a6x_neg - (0.000103758917218685*id_u6xz + (0.0281097077456599*id_u6yx + 0.0143119143826753*(id_u6xx_neg - id_u6yy_neg)))
        id_t51 = 0.000288693526842452*id_u7zx_neg - (0.0139295232094425*id_a6y - (0.0212899353705876*id_u6xy_neg + 9.3569097314605e-5*id_u6yz_neg) + id_t50)
        id_tau[6] = id_c7*id_n7y - (id_s7*id_n7x_neg - id_t51)
        id_f5x_neg = id_c6*id_f6y + (id_s6*id_f6x - (0.001208932934385*id_u5xx_neg - 0.0055993270925625*id_u5xy_neg)) ; force of link 5 and all behind it, in its frame
        id_f5y = id_t47 + (0.0189096230973375*id_u6zy - (0.0139295232094425*id_u6zx_neg + (0.001208932934385*id_u5yx + 0.0055993270925625*id_u5yy_neg)))
        id_f5z_neg = id_s6*id_f6y - (id_c6*id_f6x + (0.001208932934385*id_u5zx_neg - 0.0055993270925625*id_u5zy_neg))
        id_t52 = 0.0100451878283212*id_u5zy_neg + 0.0055993270925625*id_a5z_neg + (0.00151524447332703*id_u5zx_neg - (0.00216405205209813*id_t32 - 0.00460024551756311*id_u5yx))
        id_n5x_neg = id_c6*id_n6y - (id_s6*id_n6x_neg - id_t52) ; moment of link 5 and all behind it, in its frame
        id_t53 = 0.00151524447332703*id_u5zy_neg - 0.001208932934385*id_a5z_neg + (0.00145115606502671*id_u5zx_neg + (0.00460024551756311*(id_u4yy_neg - id_u5xx_neg) + 0.00216405205209813*id_u5xy_neg))
        id_n5y_neg = id_tau[6] - id_t53
        id_t54 = 0.00151524447332703*(id_u5xx_neg - id_u5yy_neg) + 0.00460024551756311*id_u5yz - (0.00216405205209813*id_u5xz_neg - (0.00145115606502671*id_u5yx + 0.0100451878283212*id_u5xy_neg))
        id_tau[5] = id_t54 + (0.001208932934385*id_a5y_neg + 0.0055993270925625*id_a5x_neg) - id_c6*id_n6x_neg - id_s6*id_n6y
        id_t55 = id_c5*id_f5y - id_s5*id_f5x_neg
        id_t56 = id_c5*id_f5x_neg + id_s5*id_f5y
        id_f4x = id_t56 + (0.165082793172247*id_u4xy_neg - 0.045400185158625*id_u4xx_neg) ; force of link 4 and all behind it, in its frame
        id_f4y = id_f5z_neg + (0.045400185158625*id_u4yx + 0.165082793172247*id_u4yy_neg)
        id_f4z_neg = id_t55 - (0.165082793172247*id_u4zy_neg - 0.045400185158625*id_u4zx_neg)
        id_t57 = 0.692868395030971*id_u4zy_neg + (0.0039053550262761*id_u4yx + (0.165082793172247*id_a4z - 0.00164448757736927*id_t23)) - 0.161890472685461*id_u4zx_neg
        id_n4x = id_c5*id_n5x_neg + 4.65454545454545*id_t55 - (id_s5*id_n5y_neg + id_t57) ; moment of link 4 and all behind it, in its frame
        id_t58 = 0.161890472685461*id_u4zy_neg - 0.00164448757736927*id_u4xy_neg + (0.045400185158625*id_a4z - 0.0039053550262761*(id_u3yy_neg - id_u4xx_neg) - 0.0508159486568155*id_u4zx_neg)
        id_n4y_neg = id_tau[5] - (id_t55 - id_t58)
        id_t59 = 0.0508159486568155*id_u4yx + 0.692868395030971*id_u4xy_neg - 0.161890472685461*(id_u4xx_neg - id_u4yy_neg) - 0.165082793172247*id_a4x_neg
        id_t60 = id_c5*id_n5y_neg + (id_f5z_neg + (0.045400185158625*id_a4y + (0.0039053550262761*id_u4yz + 0.00164448757736927*id_u4xz) + id_t59))
        id_tau[4] = id_t60 + (id_s5*id_n5x_neg + 4.65454545454545*id_t56)
        id_t61 = 0.0221781489648782*id_u3zy - 0.240712663426114*id_u3yx + (0.000121912420950743*id_u3zx + (0.27690780075318*id_c2 - 0.0132970191032876*id_t14))
        id_n3x_neg = id_c4*id_n4x + (id_s4*id_n4y_neg + (3.83030303030303*id_f4z_neg - id_t61)) ; moment of link 3 and all behind it, in its frame
        id_t62 = 0.000121912420950743*id_u3zy - 0.240712663426114*(id_u2yy_neg - id_u3xx_neg) + (0.0613982335265277*id_u3zx + (0.0132970191032876*id_u3xy_neg + 7.30239683634432*id_c2))
        id_n3y = 3.83030303030303*(id_s4*id_f4y - id_c4*id_f4x) - (id_tau[4] + (id_t62 - id_c4*id_f4y - id_s4*id_f4x))
        id_t63 = 0.0613982335265277*id_u3yx + (0.06141159418944*id_a3y + 0.002328735327435*id_a3x_neg) - 0.0132970191032876*id_u3xz - (0.240712663426114*id_u3yz_neg - 0.0221781489648782*id_u3xy_neg - 0.000121912420950743*(id_u3xx_neg - id_u3yy_neg))
        id_tau[3] = id_c4*id_n4y_neg + (id_f4z_neg + id_t63) - id_s4*id_n4x
        id_t64 = id_c3*id_n3x_neg - (0.0007689361029464*id_t7 - 1.02916638123188*id_u2zy_neg + (0.0102611018210082*id_u2yx - 0.00398335888393552*id_u2zx_neg))
        id_n2x_neg = id_s3*id_n3y + id_t64                   ; moment of link 2 and all behind it, in its frame
        id_t65 = 0.0102611018210082*(id_u1xx_neg - id_u2xx_neg) - 0.0230778824949318*id_u2zx_neg - (0.0007689361029464*id_u2xy_neg + 0.00398335888393552*id_u2zy_neg)
        id_n2y_neg = id_tau[3] + id_t65
        id_t66 = 0.01993386669246*id_c2 - 32.7165466268527*id_s2 - (0.0102611018210082*id_u2yz + 0.0007689361029464*id_u2xz_neg) + (0.0230778824949318*id_u2yx + 1.02916638123188*id_u2xy_neg)
        id_tau[2] = id_c3*id_n3y - (id_s3*id_n3x_neg - (0.00398335888393552*(id_u2xx_neg - id_u2yy_neg) + id_t66))
        id_tau[1] = id_s2*id_n2x_neg + (id_c2*id_n2y_neg + 0.0142595659944744*id_qdd[1])
; SPDX-License-Identifier: MIT OR Apache-2.0
