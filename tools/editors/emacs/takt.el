;;; takt.el --- Takt in Emacs  -*- lexical-binding: t -*-

;; Put this file and takt-words.el into a folder of `load-path', and (require 'takt) into init.el. The language server is used by
;; lsp-mode or Eglot (29 has it), the debugger by dap-mode: whichever is installed.

;;; Code:

(require 'prog-mode)
;; From the folder of this file, which need not be in `load-path'.
(require 'takt-words (expand-file-name "takt-words" (file-name-directory (or load-file-name buffer-file-name))))

(defgroup takt nil "Robot controllers on a processor whose every cycle is accounted for." :group 'languages)

(defcustom takt-command "takt" "The program `takt'." :type 'string)

(defcustom takt-lsp-arguments nil
  "Options of `takt lsp': (\"-m\" \"t1\" \"--deadline\" \"100us\")."
  :type '(repeat string))

(defvar takt-mode-syntax-table
  (let ((table (make-syntax-table)))
    (modify-syntax-entry ?\; "<" table)
    (modify-syntax-entry ?\n ">" table)
    (modify-syntax-entry ?. "_" table)
    ;; Operators end a name; by default, Emacs takes most of them for parts of it.
    (dolist (operator (string-to-list "+-*/%<>=&|^!~?")) (modify-syntax-entry operator "." table))
    (modify-syntax-entry ?_ "_" table)
    table))

(defvar takt-font-lock-keywords
  `(("\\.include[ \t]*\\(<[^>\n]*>\\)" 1 font-lock-string-face)
    ("^[ \t]*\\([[:alpha:]_][[:alnum:]_.{}]*\\):" 1 font-lock-constant-face)
    (,(regexp-opt takt-directives 'symbols) . font-lock-preprocessor-face)
    (,(concat (regexp-opt takt-to-labels 'symbols) "[ \t]+\\(?:[[:alnum:]_.]+[ \t]*,[ \t]*\\)?\\([[:alpha:]_][[:alnum:]_.]*\\)")
     2 font-lock-constant-face)
    (,(regexp-opt takt-mnemonics 'symbols) . font-lock-keyword-face)
    ,@(mapcar (lambda (row)
                `(,(concat "^[ \t]*" (regexp-quote (car row)) "\\_>[^;\n]*?" (regexp-opt (cdr row) 'symbols)) 1 font-lock-keyword-face))
              takt-options)
    ("\\_<\\([[:alpha:]_][[:alnum:]_.]*\\)(" 1 font-lock-function-name-face)
    (,(concat "^[ \t]*" (regexp-opt takt-declaring) "[ \t]+\\([^;=\n]*\\)") 1 font-lock-variable-name-face)
    (,(regexp-opt takt-constants 'symbols) . font-lock-constant-face)
    ("\\_<\\(?:0[xX][[:xdigit:]_]+\\|0[bB][01_]+\\|[0-9][0-9_]*\\(?:\\.[0-9_]*\\)?\\(?:[eE][-+]?[0-9]+\\)?\\)\\_>" .
     font-lock-constant-face)
    ("\\_<\\([0-9][0-9_]*\\)\\.\\." 1 font-lock-constant-face)
    ("\\.\\.[ \t]*-?\\([0-9][0-9_]*\\(?:\\.[0-9_]*\\)?\\(?:[eE][-+]?[0-9]+\\)?\\)\\_>" 1 font-lock-constant-face))
  "Colours of Takt's sources.")

;;;###autoload
(define-derived-mode takt-mode prog-mode "Takt"
  "Sources of Takt. The language server adds colours, as semantic tokens."
  (setq-local comment-start "; ")
  (setq-local comment-start-skip ";+ *")
  (setq-local font-lock-defaults '(takt-font-lock-keywords))
  (setq-local tab-width 8)
  (setq-local indent-tabs-mode nil)
  (setq-local indent-line-function #'indent-relative-first-indent-point))

;;;###autoload
(add-to-list 'auto-mode-alist '("\\.tks\\'" . takt-mode))

(defun takt-source-p ()
  "The buffer is a file *.s with a directive that GNU's assembler does not know."
  (and buffer-file-name
       (string-suffix-p ".s" buffer-file-name)
       (save-excursion
         (goto-char (point-min))
         (re-search-forward "^[ \t]*\\.\\(period\\|once\\|schedule\\|ports\\|input\\|output\\|state\\|rep\\|endfor\\)\\>" 65536 t))))

;;;###autoload
(add-to-list 'magic-mode-alist '(takt-source-p . takt-mode))

(defun takt--server (&rest _)
  "The command line of the language server."
  (append (list takt-command "lsp") takt-lsp-arguments))

(defvar lsp-language-id-configuration)
(declare-function lsp-register-client "lsp-mode")
(declare-function lsp-stdio-connection "lsp-mode")
(declare-function make-lsp-client "lsp-mode")
(with-eval-after-load 'lsp-mode
  (add-to-list 'lsp-language-id-configuration '(takt-mode . "takt"))
  (lsp-register-client
   (make-lsp-client :new-connection (lsp-stdio-connection #'takt--server)
                    :activation-fn (lambda (&rest _) (derived-mode-p 'takt-mode))
                    :server-id 'takt)))

(defvar eglot-server-programs)
(with-eval-after-load 'eglot
  (add-to-list 'eglot-server-programs '(takt-mode . takt--server)))

;;; The debugger: `dap-debug' asks which of these.

(declare-function dap-register-debug-provider "dap-mode")
(declare-function dap-register-debug-template "dap-mode")
(declare-function dap--cur-session-or-die "dap-mode")
(declare-function dap--step "dap-mode")
(with-eval-after-load 'dap-mode
  (dap-register-debug-provider
   "takt"
   (lambda (configuration) (plist-put configuration :dap-server-path (list takt-command "dap"))))
  (dap-register-debug-template
   "Takt: this file" (list :type "takt" :request "launch" :name "Takt: this file" :program "${file}"))
  (dap-register-debug-template
   "Takt: closed loop" (list :type "takt" :request "launch" :name "Takt: closed loop" :track t))
  ;; All output, since what the debugger tells is in none of the categories that are shown by default.
  (setq dap-output-buffer-filter nil))

(defun takt-step-back ()
  "Step back by a line, in the thread that is selected."
  (interactive)
  (dap--step "stepBack" (dap--cur-session-or-die)))

(defun takt-reverse-continue ()
  "Run back to a breakpoint."
  (interactive)
  (dap--step "reverseContinue" (dap--cur-session-or-die)))

(provide 'takt)
;;; takt.el ends here
