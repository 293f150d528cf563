;;; emacs_dap.el --- `takt dap' and Emacs's dap-mode  -*- lexical-binding: t -*-
;; emacs --batch -l tools/editors/emacs/takt.el -l this -f takt-test TAKT FOLDER: writes its findings to standard output as JSON.
;;; Code:

(setq user-emacs-directory (file-name-as-directory (make-temp-file "takt-emacs-" t)))
(setq package-user-dir (expand-file-name "elpa" user-emacs-directory))
(require 'json)
(require 'takt)
(require 'dap-mode)
(require 'dap-overlays)
;; dap-mode needs this for exception filters.
(require 'dap-ui)

(defvar takt-test--found (make-hash-table :test 'equal))
(defvar takt-test--stops 0)
(defvar takt-test--ended 0)

(defun takt-test--put (name value) (puthash name value takt-test--found))

(defun takt-test--wait (what condition)
  "Serve processes until CONDITION gives something: WHAT is awaited."
  (let ((end (+ (float-time) 120)) found)
    (while (not (setq found (funcall condition)))
      (when (> (float-time) end) (error "%s did not come" what))
      (accept-process-output nil 0.05))
    found))

(defun takt-test--session () (dap--cur-session))

(defun takt-test--frame ()
  "The frame at which the editor has gone to the stop, once it has."
  (takt-test--wait "a frame" (lambda () (and (takt-test--session)
                                             (dap--debug-session-active-frame (takt-test--session))))))

(defun takt-test--at ()
  "Where the editor stands: file, line and thread."
  (let ((frame (takt-test--frame)))
    (vector (file-name-nondirectory (or (buffer-file-name (window-buffer)) ""))
            (gethash "line" frame)
            (with-current-buffer (window-buffer) (line-number-at-pos))
            (dap--debug-session-thread-id (takt-test--session)))))

(defun takt-test--do (command &rest arguments)
  "Call COMMAND and wait for the next stop."
  (let ((before takt-test--stops))
    (apply command arguments)
    (takt-test--wait (format "a stop after %s" command) (lambda () (> takt-test--stops before)))
    (takt-test--at)))

(defun takt-test--ask (method &rest arguments)
  "The body of the answer to a request."
  (let (answer)
    (dap--send-message (dap--make-request method arguments) (lambda (message) (setq answer message)) (takt-test--session))
    (takt-test--wait method (lambda () answer))
    (or (gethash "body" answer) (gethash "message" answer))))

(defun takt-test--value (expression)
  (gethash "result" (takt-test--ask "evaluate" :expression expression :context "watch"
                                    :frameId (gethash "id" (takt-test--frame)))))

(defun takt-test--refused (program)
  "What the editor warns of when PROGRAM is launched."
  (let (told (ended takt-test--ended))
    (cl-letf (((symbol-function 'warn) (lambda (format &rest arguments) (setq told (apply #'format format arguments)))))
      (dap-debug (list :type "takt" :request "launch" :name "refused" :program program))
      (takt-test--wait "a refusal" (lambda () (and told (> takt-test--ended ended)))))
    told))

(defun takt-test--launch (program)
  (takt-test--do #'dap-debug (list :type "takt" :request "launch" :name program :program program)))

(defun takt-test--stop ()
  (let ((ended takt-test--ended))
    (dap-disconnect (takt-test--session))
    (takt-test--wait "the end" (lambda () (> takt-test--ended ended)))
    (dap-delete-all-sessions)))

(defun takt-test--program ()
  "One program: breakpoint, steps, back, values."
  (find-file "sum.s")
  (takt-test--put "mode" (symbol-name major-mode))
  (goto-char (point-min))
  (forward-line 11)
  (dap-breakpoint-toggle)
  (takt-test--put "entry" (takt-test--launch (expand-file-name "sum.s")))
  (takt-test--put "breakpoint" (takt-test--do (lambda () (dap-continue (takt-test--session) 1))))
  (takt-test--put "i" (takt-test--value "i"))
  (takt-test--put "out" (takt-test--do (lambda () (dap-step-out (takt-test--session)))))
  (takt-test--put "next" (takt-test--do (lambda () (dap-next (takt-test--session)))))
  (takt-test--put "back" (takt-test--do #'takt-step-back))
  (takt-test--put "reverse" (takt-test--do #'takt-reverse-continue))
  (takt-test--put "wrong" (takt-test--ask "evaluate" :expression "i +" :context "watch"))
  (takt-test--stop))

(defun takt-test--system ()
  "A system: threads, and what each core has."
  (dap-breakpoint-delete-all)
  (takt-test--launch (expand-file-name "two.toml"))
  (let ((threads (gethash "threads" (takt-test--ask "threads"))))
    (takt-test--put "threads" (mapcar (lambda (thread) (gethash "name" thread)) threads)))
  (takt-test--put "first" (takt-test--at))
  ;; Switch to the other core, as `dap-switch-thread' does.
  (setf (dap--debug-session-active-frame (takt-test--session)) nil)
  (dap--select-thread-id (takt-test--session) 2 t)
  (takt-test--put "second" (takt-test--at))
  (takt-test--put "stepped" (takt-test--do (lambda () (dap-next (takt-test--session)))))
  (takt-test--put "n" (takt-test--value "n"))
  (takt-test--stop))

(defun takt-test ()
  "All of it."
  (pcase-let ((`(,takt ,folder) command-line-args-left))
    (setq command-line-args-left nil takt-command takt)
    (cd folder)
    (add-hook 'dap-stopped-hook (lambda (&rest _) (cl-incf takt-test--stops)))
    (add-hook 'dap-terminated-hook (lambda (&rest _) (cl-incf takt-test--ended)))
    (let ((inhibit-message t))
      (condition-case problem
          (progn
            (takt-test--put "refused" (mapcar #'takt-test--refused '("none.s" "wrong.s" "broken.toml")))
            (takt-test--program)
            (takt-test--system))
        (error (takt-test--put "problem" (error-message-string problem)))))
    (princ (json-encode takt-test--found))
    (terpri)))

;;; emacs_dap.el ends here
