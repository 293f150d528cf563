" Takt in Vim and Neovim. Generated from the tables by `cargo xtask docs`; do not edit.
if exists('b:current_syntax')
  finish
endif
syntax iskeyword @,48-57,_,.
syntax keyword taktDirective .machine .reg .state .input .output .array .const .param .preset .once .period .data .float .word .space .macro .endm .rep .endr .for .endfor .if .elif .else .endif .include .loc .error .schedule .contract .fast .ports .loop_bound .range .result .assume .deadline .order .late .raw
syntax keyword taktMnemonic nop jmp bz bnz call ret wait halt loop publish ld st mov li iadd isub iand ior ixor ishl ishr isar ieq ilt iltu sel rdflags clrflags fabs fneg fsign fmin fmax fsat feq flt fle fadd fsub itof ftoi fmul fdiv fsqrt imul24 fma fms fnma fnms fsin fcos fatan2 facos
syntax keyword taktConstant pi PI inf nan
syntax match taktNumber /\v(\.\.@2<=|[0-9A-Za-z_.}]@1<!)(0[xX]\x[0-9a-fA-F_]*|0[bB][01][01_]*|\d[0-9_]*(\.\.@![0-9_]*)?([eE][-+]?\d+)?|\.\d[0-9_]*([eE][-+]?\d+)?)/
syntax match taktFunction /[A-Za-z_][A-Za-z0-9_.]*\ze(/
syntax match taktName /\(^\s*\.\(const\|param\|input\|output\|state\|reg\|array\)\s\+\)\@<=[^;=]*/ contains=taktNumber,taktOption
syntax match taktOption /\v(^\s*\.machine\s[^;]*)@<=<(code|data)>/
syntax match taktOption /\v(^\s*\.param\s[^;]*)@<=<(range)>/
syntax match taktOption /\v(^\s*\.for\s[^;]*)@<=<(step|unroll|max)>/
syntax match taktOption /\v(^\s*\.schedule\s[^;]*)@<=<(on|off)>/
syntax match taktOption /\v(^\s*\.contract\s[^;]*)@<=<(on|off)>/
syntax match taktOption /\v(^\s*\.fast\s[^;]*)@<=<(reassociate|reciprocal|off)>/
syntax match taktOption /\v(^\s*\.ports\s[^;]*)@<=<(latched|direct)>/
syntax match taktOption /\v(^\s*\.loop_bound\s[^;]*)@<=<(total)>/
syntax match taktLabel /\v(<(jmp|bz|bnz|call|wait|loop)\s+([A-Za-z0-9_.]+\s*,\s*)?)@<=<[A-Za-z_][A-Za-z0-9_.]*>(\s*,)@!/
syntax match taktLabel /^\s*[A-Za-z_][A-Za-z0-9_.{}]*\ze:/
syntax match taktFile /\(\.include\s*\)\@<=<[^>]*>/
syntax region taktText start=/"/ skip=/\\./ end=/"/ oneline
syntax match taktComment /;.*$/ contains=@Spell
highlight default link taktDirective PreProc
highlight default link taktMnemonic Statement
highlight default link taktOption Keyword
highlight default link taktFunction Function
highlight default link taktConstant Constant
highlight default link taktName Identifier
highlight default link taktNumber Number
highlight default link taktLabel Label
highlight default link taktFile String
highlight default link taktText String
highlight default link taktComment Comment
let b:current_syntax = 'takt'
