;;; takt-words.el --- Words of Takt's sources  -*- lexical-binding: t -*-

;; Generated from the tables by `cargo xtask docs'; do not edit.

;;; Code:

(defconst takt-directives
  '(".machine" ".reg" ".state" ".input" ".output" ".array" ".const" ".param" ".preset" ".once" ".period" ".data" ".float" ".word" ".space" ".macro" ".endm" ".rep" ".endr" ".for" ".endfor" ".if" ".elif" ".else" ".endif" ".include" ".loc" ".error" ".schedule" ".contract" ".fast" ".ports" ".loop_bound" ".range" ".result" ".assume" ".deadline" ".order" ".late" ".raw")
  "Directives.")

(defconst takt-mnemonics
  '("nop" "jmp" "bz" "bnz" "call" "ret" "wait" "halt" "loop" "publish" "ld" "st" "mov" "li" "iadd" "isub" "iand" "ior" "ixor" "ishl" "ishr" "isar" "ieq" "ilt" "iltu" "sel" "rdflags" "clrflags" "fabs" "fneg" "fsign" "fmin" "fmax" "fsat" "feq" "flt" "fle" "fadd" "fsub" "itof" "ftoi" "fmul" "fdiv" "fsqrt" "imul24" "fma" "fms" "fnma" "fnms" "fsin" "fcos" "fatan2" "facos")
  "Names of instructions.")

(defconst takt-constants
  '("pi" "PI" "inf" "nan")
  "Names of constants.")

(defconst takt-declaring
  '(".const" ".param" ".input" ".output" ".state" ".reg" ".array")
  "Directives that declare names.")

(defconst takt-to-labels
  '("jmp" "bz" "bnz" "call" "wait" "loop")
  "Names of instructions with a label among the operands.")

(defconst takt-options
  '((".machine" "code" "data") (".param" "range") (".for" "step" "unroll" "max") (".schedule" "on" "off") (".contract" "on" "off") (".fast" "reassociate" "reciprocal" "off") (".ports" "latched" "direct") (".loop_bound" "total"))
  "Directives with words of their own, and these.")

(provide 'takt-words)
;;; takt-words.el ends here
