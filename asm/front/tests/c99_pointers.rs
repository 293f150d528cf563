// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pointers that data choose: one of several objects, or none; against gcc, bit for bit.

use crate::c99::{check, refused};

#[test]
fn one_of_two_motors() {
    let code = r#"
struct motor { float i, u; int n; };
static struct motor left, right;
static void regulate(struct motor *m, float x)
{
    float e = x - m->i;
    m->i += 0.25f * e;
    if (m->i > 3) { m->n++; m->i -= 3; return; }
    m->u = e;
}
float step(int n, float x)
{
    struct motor *m = n & 1 ? &left : &right;
    regulate(m, x);
    float u = m->u + (float)m->n;
    for (int k = 0; k < 3; k++) m->i += u * (float)k;
    m->n = m == &left ? 7 : m->n + 1;
    return left.u + 2*right.u + (float)left.n + 10*(float)right.n + m->i;
}
"#;
    check("one_of_two_motors", code);
    let branch = code.replace(
        "struct motor *m = n & 1 ? &left : &right;",
        "struct motor *m = &right; if (n & 1) m = &left;",
    );
    check("one_of_two_motors_by_if", &branch);
}

/// The null pointer as a result: tested directly, by a flag, negated, with `&&` and `||`, and passed on.
#[test]
fn an_element_or_none() {
    let items = r#"
#include <stdbool.h>
#include <stddef.h>
struct item { int id; float gain; };
static struct item items[4] = { {3, 1.5f}, {5, 2.0f}, {-7, 0.5f}, {9, 4.0f} };
static struct item *find(int id)
{
    for (int k = 0; k < 4; k++) if (items[k].id == id) return &items[k];
    return NULL;
}
"#;
    for (name, body) in [
        ("tested", "if (t) { g = t->gain; t->gain *= 0.5f; } else g = 3;"),
        ("compared", "if (t != NULL && t->id > 3) g = t->gain; if (NULL == t || t->gain < 1) g += 8;"),
        ("left_early", "if (!t) return -1; g = t->gain; t->id++;"),
        (
            "in_a_flag",
            "bool found = t != NULL; int b = !t; if (found) { t->gain += 1; g = t->gain; } g += (float)b;",
        ),
        ("as_a_number", "g = (float)(t == 0) + (float)!!t + ((bool)t ? 5 : 7);"),
        ("handed_over", "struct item *u = t ? t : &items[n & 3]; u->gain += 2; g = u->gain;"),
        (
            "compared_with_others",
            "if (t == &items[2]) g = 5; else if (t && t - items > 0) g = (float)(t - items);",
        ),
        (
            "copied",
            "struct item c = { 1, 2 }; if (t) c = *t; g = c.gain + (float)c.id; if (t) *t = (struct item){ n, g };",
        ),
    ] {
        let code = format!(
            "{items}float step(int n, float x)\n{{\n    struct item *t = find(n & 1 ? n % 11 : 3);\n    float g = x;\n    {body}\n    \
             return g + items[0].gain + items[1].gain + (float)items[3].id;\n}}\n"
        );
        check(&format!("an_element_or_none_{name}"), &code);
    }
}

/// Branches too long for selections: the choice leaves them in variables.
#[test]
fn choices_behind_branches() {
    let long = "a = sqrtf(a*a + 1); a = a/(1 + a); a = sqrtf(a*a + 2); a = a/(2 + a); a = sqrtf(a*a + 3); a = a/(3 + a); \
                a = sinf(a) + cosf(a); a = sinf(a) + cosf(a); a = expf(-a*a); a = expf(-a*a);";
    check(
        "choices_behind_branches",
        &format!(
            "#include <math.h>\nstruct s {{ float v[3]; int n; }}; static struct s one, two, three;\n\
             float step(int n, float x)\n{{\n    struct s *p = 0; float a = x > 100 || x < -100 ? 1 : x;\n\
             if (n > 0) {{ {long} p = n > 5 && a > 0.25f ? &one : &two; p->v[1] += a; }}\n\
             else if (n > -5) {{ {long} p = &three; p->n++; }}\n\
             struct s *q = p; if (!q) return 0.5f;\n\
             q->v[n & 1] += a; q->n += n;\n\
             if (a > 0) {{ {long} q->v[2] = a; }} else {{ {long} q = &one; }}\n\
             return q->v[0] + q->v[1] + q->v[2] + (float)(one.n + two.n) + (float)three.n;\n}}\n"
        ),
    );
}

#[test]
fn three_objects_arrays_and_functions() {
    check(
        "three_objects",
        r#"
struct s { float x; int n; }; static struct s a, b, c;
static struct s *of(int n) { switch (n & 3) { case 0: return &a; case 1: return &b; case 2: return &c; default: return 0; } }
int step(int n, float x)
{
    struct s *p = of(n), *q = of(n >> 2);
    if (p) p->x += x;
    if (q && p) { q->n += p == q ? 1 : 2; p->n ^= q->n; }
    if (p != q) { if (q) q->x -= x; }
    return a.n + b.n*3 + c.n*5 + (a.x < b.x)*64 + (b.x < c.x)*128;
}
"#,
    );
    check(
        "tables_that_data_choose",
        r#"
static const float fast[4] = { 1, 2, 3, 4 }, slow[4] = { 0.5f, 0.25f, 0.125f, 0.0625f };
static float ring[2][4], other[4];
static float dot(const float *a, const float *b, int n) { float s = 0; for (int i = 0; i < n; i++) s += a[i]*b[i]; return s; }
float step(int n, float x)
{
    const float *c = x > 0 ? fast : slow;
    float *r = n & 1 ? other : ring[(n >> 1) & 1];
    r[(n >> 2) & 3] = x;
    *r += 1;
    float *end = r + 4, s = 0;
    for (float *p = r; p < end; p++) s += *p;
    return dot(c, r, 4) + c[n & 3] + s + (float)(end - r);
}
"#,
    );
    check(
        "functions_that_data_choose",
        r#"
static int plus(int a, int b) { return a + b; }
static int less(int a, int b) { return a - b; }
static int (*mode)(int, int);
int step(int n, int m)
{
    int (*f)(int, int) = n & 1 ? plus : less;
    mode = n & 2 ? f : 0;
    int r = f(n, m);
    if (mode) r ^= mode(m, r);
    return r + (f == plus) + (*f)(1, 2);
}
"#,
    );
    check(
        "tables_of_pointers",
        r#"
struct s { float x; int n; }; static struct s a, b, c;
static struct s *const all[3] = { &a, &b, &c };
static int idle(struct s *s, int n) { s->n = n; return 0; }
static int run(struct s *s, int n) { s->n += n; return s->n > 50 ? 2 : 1; }
static int stop(struct s *s, int n) { s->x += (float)n; return n > 0; }
static int (*const states[3])(struct s *, int) = { idle, run, stop };
static unsigned state;
static struct { const char *name; int (*get)(struct s *, int); } rows[2] = { { "a", run }, { "bc", stop } };
int step(unsigned n, int m)
{
    struct s *p = all[n % 3];
    int (*enter)(struct s *, int) = states[state];
    state = (unsigned)enter(p, m);
    if (all[m & 1] == p) p->n += 5;
    const char *name = rows[n & 1].name;
    int (*get)(struct s *, int) = rows[n & 1].get;
    return a.n + b.n*3 + c.n*5 + (a.x < c.x) + (int)state*7 + name[0] + get(&b, 2);
}
"#,
    );
    check(
        "lists_and_arrays_with_pointers",
        r#"
typedef struct { float ki, limit; } cfg;
static const cfg slow = { 0.5f, 5 }, fast = { 2, 12 };
typedef struct axis { float sum, out; const cfg *of; struct axis *next; unsigned char fault; short last[2]; } axis;
static axis axes[3] = { { 0, 0, &slow, &axes[1] }, { 0, 0, &slow, &axes[2] }, { 0, 0, &slow, 0 } };
static axis *worst(void)
{
    axis *w = 0;
    for (axis *a = axes; a; a = a->next) if (!w || a->out > w->out) w = a;
    return w;
}
float step(unsigned n, int m, float x)
{
    for (axis *a = axes; a; a = a->next) { a->sum += a->of->ki*x; a->out = a->sum > a->of->limit ? a->of->limit : a->sum - x; x *= -0.5f; }
    axis *w = worst(), *b = &axes[n % 3];
    b->last[m & 1] += 3; b->fault++;
    struct { int k; const cfg *of; } rows[3] = { { 1, &slow }, { 2, &fast }, { m, &slow } };
    rows[m & 1].of = m & 4 ? &fast : &slow; rows[n & 1].k += m;
    const cfg *c = rows[(n >> 1) & 1].of;
    w->sum += c->ki*(float)rows[n % 3].k;
    axes[n & 1].sum *= 0.5f;
    w->sum -= w->of->limit;
    return w->out + (float)(w - axes) + axes[0].last[0] + axes[1].last[1]*3 + (float)b->fault + (float)axes[(m & 3) % 3].last[1];
}
"#,
    );
    check(
        "copies_between_chosen_objects",
        r#"
#include <string.h>
struct s { int v[3]; float x; }; static struct s a, b;
int step(int n, float x)
{
    struct s *p = n & 1 ? &a : &b, *q = n & 2 ? &b : &a;
    p->v[n & 1] = n; q->x = x;
    memcpy(p->v, q->v, sizeof p->v);
    if (n & 8) memset(q, 0, sizeof *q);
    struct s t = *p; *p = *q; *q = t;
    int *w = n & 4 ? &p->v[2] : &q->v[0];
    *w += 3; (*w)++;
    return a.v[0] + a.v[1]*2 + a.v[2]*4 + b.v[0]*8 + b.v[1]*16 + b.v[2]*32 + (a.x > b.x);
}
"#,
    );
}

#[test]
fn refuses_what_it_cannot_follow() {
    let declared = "struct s { int n; }; static struct s a, b;\n";
    let text = refused(
        "a_choice_without_a_name",
        &format!("{declared}int step(int n) {{ return (n ? &a : &b)->n + 1; }}\n"),
    );
    assert!(text.contains("put the pointer into a variable"), "{text}");
    let text = refused(
        "a_choice_that_outlives_the_step",
        &format!(
            "{declared}static struct s *p = &a; int step(int n) {{ p->n += n; p = n & 1 ? &a : &b; return a.n; }}\n"
        ),
    );
    assert!(text.contains("outlives it: keep an index"), "{text}");
    let text = refused(
        "a_called_entry",
        "static int f(int x) { return x; } static int g(int x) { return -x; } static int (*const all[2])(int) = { f, g };\n\
         int step(int n) { return all[n & 1](n); }\n",
    );
    assert!(text.contains("put the pointer into a variable"), "{text}");
    let text = refused("null_alone", "int step(int n) { int *p = 0; int *q = n ? p : 0; return *q; }\n");
    assert!(text.contains("null pointer"), "{text}");
    let text = refused(
        "a_local_of_another_function",
        &format!(
            "{declared}static struct s *of(int n) {{ struct s own = {{ n }}; return n & 1 ? &own : &a; }}\n\
                  int step(int n) {{ struct s *p = of(n); return p->n; }}\n"
        ),
    );
    assert!(text.contains("function that has returned"), "{text}");
    let text = refused(
        "a_walk_among_objects",
        "static struct s { int v; } a, b; int step(unsigned char n) { struct s *p = &a; for (int i = 0; i < n; i++) { p->v += i*n; p = p == &a ? &b : &a; } return a.v; }\n",
    );
    assert!(text.contains("several objects"), "{text}");
}
