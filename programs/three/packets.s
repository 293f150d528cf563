; The numbers that go between host, communication and kinematic core. docs/controller.md.

; ---- Packets from the host ------------------------------------------------------------------------------------------------
.const  MAGIC = 0x54                    ; bits 31 to 24 of a header
.const  PAYLOAD_WORDS = 12              ; at most
.const  KIND_NOP    = 0
.const  KIND_MOVE   = 1
.const  KIND_MOVEL  = 2
.const  KIND_JOG    = 3
.const  KIND_STOP   = 4
.const  KIND_OUTPUT = 5
.const  KIND_LEVEL  = 6
.const  KIND_RESET  = 7
.const  KIND_TOOL   = 8
.const  KIND_LIMITS = 9
.const  KINDS       = 10
.const  KIND_TORQUES = KINDS            ; LIMITS, second half: an item only, no packet

.const  PROFILE_RECTANGULAR = 0         ; shape of the acceleration
.const  PROFILE_TRAPEZOIDAL = 1
.const  PROFILE_PARABOLIC   = 2
.const  PROFILE_COSINE      = 3
.const  PROFILES            = 4

.const  HOW_TIME  = 0
.const  HOW_SPEED = 1
.const  HOW_FAST  = 2
.const  HOWS      = 3

.const  FLAG_VIA   = 1
.const  FLAG_CHECK = 2
.const  FLAGS      = 3

.const  JOG_JOINTS  = 0
.const  JOG_WORLD   = 1
.const  JOG_GRIPPER = 2
.const  JOGS        = 3

; ---- Reports to the host ----------------------------------------------------------------------------------------------------
.const  REPORT_ACCEPTED = 1
.const  REPORT_STARTED  = 2
.const  REPORT_FINISHED = 3
.const  REPORT_REFUSED  = 4
.const  REPORT_STOPPED  = 5
.const  REPORT_READY    = 6
.const  REPORT_CHECKED  = 7

.const  CAUSE_CRC            = 1
.const  CAUSE_SEQUENCE       = 2
.const  CAUSE_HEADER         = 3
.const  CAUSE_LATE           = 4
.const  CAUSE_SILENT         = 5
.const  CAUSE_NOTFINITE      = 6
.const  CAUSE_JOINTLIMIT     = 7
.const  CAUSE_UNREACHABLE    = 8
.const  CAUSE_SINGULAR       = 9
.const  CAUSE_VELOCITYLIMIT  = 10
.const  CAUSE_TORQUELIMIT    = 11
.const  CAUSE_QUEUEFULL      = 12
.const  CAUSE_STOPPEDSTATE   = 13
.const  CAUSE_TRACKING       = 14
.const  CAUSE_RANDRY         = 15
.const  CAUSE_NOTWHILEMOVING = 16
.const  CAUSE_DEADLINE       = 17

; ---- Between the cores ---------------------------------------------------------------------------------------------------------
.const  QUEUE = 32                      ; items that wait for the kinematic core at most: depth of the FIFO `items`

; Bits beside a reply's kind.
.const  REPLY_DONE  = 0x100             ; a motion, an output or a level leaves the queue
.const  REPLY_SET   = 0x200             ; the queue has come to an output or a level: cause and value are its two words
.const  REPLY_LOCK  = 0x400             ; only a reset ends this
.const  REPLY_HALTED = 0x800            ; it stands after a stop
.const  REPLY_JOGGED = 0x1000           ; a jog has ended

.const  MODE_STANDING = 0
.const  MODE_MOVING   = 1
.const  MODE_JOGGING  = 2
.const  MODE_STOPPING = 3
.const  MODE_ERROR    = 4
; SPDX-License-Identifier: MIT OR Apache-2.0
