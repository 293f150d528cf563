; Generated from the tables by `cargo xtask docs`; do not edit.

(comment) @comment
(text) @string
(library) @string.special.path
(number) @constant.numeric

[".machine" ".reg" ".state" ".input" ".output" ".array" ".const" ".param" ".preset" ".once" ".period" ".data" ".float" ".word" ".space" ".macro" ".endm" ".rep" ".endr" ".for" ".endfor" ".if" ".elif" ".else" ".endif" ".include" ".loc" ".error" ".schedule" ".contract" ".fast" ".ports" ".loop_bound" ".range" ".result" ".assume" ".deadline" ".order" ".late" ".raw"] @keyword.directive

(operation mnemonic: (identifier) @keyword (#any-of? @keyword "nop" "jmp" "bz" "bnz" "call" "ret" "wait" "halt" "loop" "publish" "ld" "st" "mov" "li" "iadd" "isub" "iand" "ior" "ixor" "ishl" "ishr" "isar" "ieq" "ilt" "iltu" "sel" "rdflags" "clrflags" "fabs" "fneg" "fsign" "fmin" "fmax" "fsat" "feq" "flt" "fle" "fadd" "fsub" "itof" "ftoi" "fmul" "fdiv" "fsqrt" "imul24" "fma" "fms" "fnma" "fnms" "fsin" "fcos" "fatan2" "facos"))
(operation mnemonic: (identifier) @function.macro (#not-any-of? @function.macro "nop" "jmp" "bz" "bnz" "call" "ret" "wait" "halt" "loop" "publish" "ld" "st" "mov" "li" "iadd" "isub" "iand" "ior" "ixor" "ishl" "ishr" "isar" "ieq" "ilt" "iltu" "sel" "rdflags" "clrflags" "fabs" "fneg" "fsign" "fmin" "fmax" "fsat" "feq" "flt" "fle" "fadd" "fsub" "itof" "ftoi" "fmul" "fdiv" "fsqrt" "imul24" "fma" "fms" "fnma" "fnms" "fsin" "fcos" "fatan2" "facos"))
(macro_definition name: (identifier) @function.macro)
(macro_definition parameter: (identifier) @variable.parameter)
(counted_loop option: (identifier) @keyword)
(label name: (identifier) @label)
[(template_begin) (template_middle) (template_end)] @variable
(const_directive name: (identifier) @constant)
(cast type: (identifier) @type)
(declaration type: (identifier) @type)
(macro_definition type: (identifier) @type)
(call function: (identifier) @function.builtin (#any-of? @function.builtin "sqrt" "sin" "cos" "tan" "atan2" "asin" "acos" "exp" "log" "abs" "min" "max" "floor" "ceil" "round" "int" "float" "xor" "bits"))

([
  (binary (identifier) @constant.builtin)
  (unary operand: (identifier) @constant.builtin)
  (parenthesized (identifier) @constant.builtin)
  (call (identifier) @constant.builtin)
  (choice (identifier) @constant.builtin)
  (const_directive value: (identifier) @constant.builtin)
  (float_directive (identifier) @constant.builtin)
  (equation value: (identifier) @constant.builtin)
] (#any-of? @constant.builtin "pi" "PI" "e" "inf" "nan"))

(binary operator: _ @operator)
(unary operator: _ @operator)
(choice ["?" ":"] @operator)
"||" @operator
"=" @operator
["(" ")" "[" "]"] @punctuation.bracket
"," @punctuation.delimiter
