// SPDX-License-Identifier: MIT OR Apache-2.0
//! C through `takt cc` on t1, t3, t4 against gcc, construct by construct, bit for bit; and the messages about refused programs.

use crate::common::gcc::{Program, assembled, emulated, folder, matches_gcc, translated};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{Rng, SeedableRng};
use takt_isa::T3;

/// Periods of a case.
const PERIODS: usize = 40;

/// Inputs of all kinds: small and large numbers, halves, zeros of both signs.
pub(crate) fn word(random: &mut Pcg32, float: bool) -> u32 {
    if !float {
        return match random.next_u32() % 4 {
            0 => random.next_u32(),
            1 => random.next_u32() % 7,
            _ => (random.next_u32() % 401).wrapping_sub(200),
        };
    }
    let size = (random.next_u32() % 2_000_001) as f32 - 1_000_000.0;
    let value = match random.next_u32() % 8 {
        0 => [0.0, -0.0, 1.0, -1.0, 0.5, 2.5, -3.5, 100.0][(random.next_u32() % 8) as usize],
        1 => size,
        2 => (size / 5e5).round(),
        _ => size * 1e-5,
    };
    value.to_bits()
}

pub(crate) fn check(name: &str, code: &str) -> takt_front::c::Translation {
    matches_gcc(&Program::new(name, code), |translation| {
        let mut random = Pcg32::seed_from_u64(name.bytes().fold(7, |sum, byte| sum * 31 + u64::from(byte)));
        let row = |_| translation.inputs.iter().map(|port| word(&mut random, port.float)).collect();
        (0..PERIODS).map(row).collect()
    })
}

/// The message about a refused program.
pub(crate) fn refused(name: &str, code: &str) -> String {
    let folder = folder(name);
    let mut program = Program::new(name, code);
    program.double_is_float = false;
    let message = translated(&program, &folder).expect_err("it is refused");
    let _ = std::fs::remove_dir_all(folder);
    message
}

#[test]
fn computes_sums_in_their_order() {
    check(
        "computes_sums_in_their_order",
        r#"float step(float a, float b) { return a*b + a/(b*b + 1.0f) - -a; }
"#,
    );
}

/// Numbers of more digits than binary32 or binary64 hold, at a tie and just above and below one.
#[test]
fn hexadecimal_literals_round_once() {
    check(
        "hexadecimal_literals_round_once",
        r#"float step(float x) {
  const float a[6] = {0x1.8p-3f, 0x1.0000010000000001p0f, 0x1.000001p0f, 0x0.fffffefffffffffffffffffp4f, 0x.8p1f, 0x1.fffffefp127f};
  float sum = x;
  for (int i = 0; i < 6; i++) sum = a[i] - 2.0f*sum;
  return sum; }
"#,
    );
}

#[test]
fn keeps_a_static_as_state() {
    check(
        "keeps_a_static_as_state",
        r#"static float sum = 0.5f;
float step(float x) { sum += 0.1f*x; return sum; }
"#,
    );
}

#[test]
fn chooses_by_if() {
    check(
        "chooses_by_if",
        r#"float step(float x, float y) {
  float r;
  if (x > y) { r = x - y; } else if (x < -1.0f) r = y*y; else r = 0.25f;
  if (r > 2.0f) r = 2.0f;
  return r; }
"#,
    );
}

#[test]
fn returns_early() {
    check(
        "returns_early",
        r#"static float limit(float x, float low, float high) { if (x < low) return low; if (x > high) return high; return x; }
float step(float x) { if (x == 0.0f) return 7.0f; return limit(x*3.0f, -2.0f, 2.0f) + limit(x, -0.5f, 0.5f); }
"#,
    );
}

#[test]
fn chooses_by_conditional() {
    check(
        "chooses_by_conditional",
        r#"float step(float x, float y) { return x > 0.0f ? y : x < -1.0f ? y*x : 3.0f; }
"#,
    );
}

#[test]
fn short_circuits() {
    check(
        "short_circuits",
        r#"static int n;
static int count(float x) { n++; return x > 0.0f; }
int step(float x, float y) { int r = 0; if (count(x) && count(y)) r += 1; if (count(y) || count(x)) r += 2; if (!(x > y)) r += 4; return r*1000 + n; }
"#,
    );
}

#[test]
fn reads_and_writes_structures() {
    check(
        "reads_and_writes_structures",
        r#"struct pid { float kp, ki; float sum; float last; };
void init(struct pid *p) { p->kp = 2.0f; p->ki = 0.01f; p->sum = 0; p->last = 0; }
float step(struct pid *p, float e) { p->sum += p->ki*e; float d = e - p->last; p->last = e; return p->kp*e + p->sum + 0.1f*d; }
"#,
    );
}

#[test]
fn passes_structures_by_value() {
    check(
        "passes_structures_by_value",
        r#"typedef struct { float x, y, z; } vec;
static vec add(vec a, vec b) { vec r = { a.x + b.x, a.y + b.y, a.z + b.z }; return r; }
static vec scale(float s, vec a) { return (vec){ s*a.x, s*a.y, s*a.z }; }
static float dot(vec a, vec b) { return a.x*b.x + a.y*b.y + a.z*b.z; }
vec step(vec a, vec b) { vec c = add(scale(2.0f, a), b); if (dot(c, a) > 1.0f) c = scale(0.5f, c); return c; }
"#,
    );
}

#[test]
fn writes_what_pointers_point_to() {
    check(
        "writes_what_pointers_point_to",
        r#"#include <math.h>
static void polar(float x, float y, float *r, float *s) { *r = sqrtf(x*x + y*y); *s = x + y; }
void step(float x, float y, float *r, float *s) { float q; polar(x, y, r, &q); *s = q*2.0f; }
"#,
    );
}

#[test]
fn swaps_in_place() {
    check(
        "swaps_in_place",
        r#"void step(float *a, float *b) { float t = *a; *a = *b; *b = t; }
"#,
    );
}

#[test]
fn sums_over_arrays() {
    check(
        "sums_over_arrays",
        r#"static const float w[4] = { 0.5f, -1.0f, 2.0f, 0.25f };
float step(const float x[4]) { float sum = 0; for (int i = 0; i < 4; i++) sum += w[i]*x[i]; return sum; }
"#,
    );
}

#[test]
fn rotates_matrices() {
    check(
        "rotates_matrices",
        r#"void step(const float a[9], float b[9]) {
  float m[3][3];
  for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) m[i][j] = a[3*j + i];
  for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) { b[3*i + j] = 0; for (int k = 0; k < 3; k++) b[3*i + j] += m[i][k]*a[3*k + j]; } }
"#,
    );
}

#[test]
fn indexes_tables_by_data() {
    check(
        "indexes_tables_by_data",
        r#"static const float table[8] = { 1, 4, 9, 16, 25, 36, 49, 64 };
static const short offsets[4] = { -5, 3, 100, -200 };
float step(int n, float x) { return table[n & 7]*x + offsets[(n >> 3) & 3]; }
"#,
    );
}

#[test]
fn keeps_a_ring() {
    check(
        "keeps_a_ring",
        r#"static float ring[8]; static unsigned at;
float step(float x) { float old = ring[at]; ring[at] = x; at = (at + 1) & 7; return old + ring[(at + 3) & 7]; }
"#,
    );
}

#[test]
fn rolls_long_loops() {
    check(
        "rolls_long_loops",
        r#"static float line[64];
float step(float x) { for (int i = 63; i > 0; i--) line[i] = line[i-1]; line[0] = x; float s = 0; for (int i = 0; i < 64; i++) s += line[i]*(0.1f*i); return s; }
"#,
    );
}

#[test]
fn keeps_values_over_loops() {
    check(
        "keeps_values_over_loops",
        r#"float step(float x) { float a = x, b = 1.0f; int n = 0; for (int i = 0; i < 100; i++) { float t = a; a = b; b = t*0.5f + 0.25f; if (b > a) n++; x += a; } return x + n; }
"#,
    );
}

#[test]
fn loops_to_a_bound() {
    check(
        "loops_to_a_bound",
        r#"float step(float a) { float angle = a > 20.0f ? 20.0f : a;
#pragma takt loop_bound(5)
  while (angle > 3.0f) angle -= 6.0f;
  return angle; }
"#,
    );
}

/// A number that an iteration brings towards its range needs no pragma.
#[test]
fn wraps_angles() {
    check(
        "wraps_angles",
        r#"#include <math.h>
static void norm(float *angle) { while (*angle < -3.1415927f) { *angle += 6.2831855f; } while (*angle > 3.1415927f) { *angle -= 6.2831855f; } }
float step(float a, int n) { float angle = fminf(fmaxf(a, -30.0f), 30.0f); norm(&angle); int turns = n & 1023; while (turns >= 360) turns = turns - 360; return angle + turns; }
"#,
    );
}

/// A loop ends where the type of its end does.
#[test]
fn loops_to_an_end_of_a_narrow_type() {
    check(
        "loops_to_an_end_of_a_narrow_type",
        r#"#include <stdint.h>
float step(float x, uint8_t n, int m) { float s = 0.0f; for (int i = 0; i < n; i++) s += x; for (int i = m & 15; i > 0; i--) s = s*0.5f; return s; }
"#,
    );
}

#[test]
fn divides_integers() {
    check(
        "divides_integers",
        r#"#include <stdint.h>
int step(int a, int b, unsigned u, int16_t s, int16_t t) {
  int d = b ? b : 3; if (d == -1) d = 1; unsigned e = u ? u : 7u; int t1 = t ? t : 5; unsigned long v = (unsigned)a;
  int r = a/d + a%d + a/10 + a%1000 + a/-7 + a%-360 + s/t1 + s%t1 + s/3 + s%100 + a/2147483647 + (a & 0xffff)/60;
  return r + (int)(v/e + v%e + u/10u + u%3600u + u/0x90000001u + u%0xfffffff0u); }
"#,
    );
}

#[test]
fn divides_by_the_least_integer() {
    check(
        "divides_by_the_least_integer",
        r#"#include <limits.h>
int step(int a, int b) { int x = b > 0 ? INT_MIN : a; return a/INT_MIN + 3*(a%INT_MIN) + x/INT_MIN + x/3 + x%10; }
"#,
    );
}

#[test]
fn computes_statement_expressions() {
    check(
        "computes_statement_expressions",
        r#"#define MAX(a, b) __extension__ ({ __typeof__(a) a_ = (a); __typeof__(b) b_ = (b); a_ > b_ ? a_ : b_; })
float step(float a, float b, int n) { return MAX(a*2.0f, b) + MAX(n, 3); }
"#,
    );
}

/// The places of a packed structure's members decide which word a union's other member reads.
#[test]
fn packs_structures() {
    check(
        "packs_structures",
        r#"#include <stdint.h>
#include <string.h>
struct __attribute__((packed)) tight { uint8_t a; uint32_t b; };
typedef struct { uint16_t a; float b; } __attribute__((__packed__)) tight2;
struct loose { uint8_t a; uint32_t b; };
#pragma pack(push, 1)
struct pragma { uint8_t a; float b; uint8_t c; };
#pragma pack(pop)
struct after { uint8_t a; float b; };
int step(int a) { tight2 t = { 3, 2.5f }; return a + sizeof(struct tight) + 10*sizeof(tight2) + 100*sizeof(struct loose) + 1000*sizeof(struct pragma) + 10000*sizeof(struct after) + (int)t.b; }
"#,
    );
}

/// Declarations that are not translated matter where they are used.
#[test]
fn passes_over_unused_declarations() {
    check(
        "passes_over_unused_declarations",
        r#"struct flags { unsigned a : 3; unsigned b : 5; };
typedef struct { unsigned on : 1; } registers;
extern registers *port;
float _Complex unused(float _Complex z);
float step(float a) { return 2.0f*a; }
"#,
    );
    let message = refused(
        "refuses_a_declaration_that_is_used",
        r#"typedef struct { unsigned on : 1; } registers;
float step(float a) {
  registers r = { 1 };
  return a + r.on; }
"#,
    );
    for part in [":1:", "bit-fields"] {
        assert!(message.contains(part), "{message}");
    }
}

/// An index that data decide extends what a pointer points to, by its range.
#[test]
fn indexes_what_pointers_point_to() {
    let translation = check(
        "indexes_what_pointers_point_to",
        r#"struct point { float x, y; };
float step(const float *x, int i, float *y) { y[i & 3] = x[i & 7]; return x[(i >> 3) & 7]; }
"#,
    );
    assert_eq!(translation.inputs.len(), 8 + 1 + 4);
    let message =
        refused("refuses_an_index_without_a_range", "float step(const float *x, int i) { return x[i]; }\n");
    for part in [":1:", "`x[N]`"] {
        assert!(message.contains(part), "{message}");
    }
}

/// A pointer in the caller's structure that nothing sets points to something of the caller's.
#[test]
fn follows_pointers_in_structures() {
    let program = Program::new(
        "follows_pointers_in_structures",
        r#"struct limits { float low, high; };
struct conf { float gain; struct limits *limits; };
struct motor { struct conf *conf; float *table; float sum; };
float step(struct motor *m, float x) { struct conf *c = m->conf; m->sum += c->gain*x; if (m->sum > c->limits->high) m->sum = c->limits->high; return m->sum + m->table[2]; }
"#,
    );
    let folder = folder(&program.name);
    let translation = translated(&program, &folder).expect("it is translated");
    let value = |name: &str, period: u16| match name {
        "m_conf_gain" => 0.5,
        "m_conf_limits_high" => 3.0,
        "m_table[3]" => 100.0,
        "x" => f32::from(period),
        name => panic!("{name}\n{}", translation.text),
    };
    let row = |period| translation.inputs.iter().map(|port| value(&port.name, period).to_bits()).collect();
    let rows: Vec<Vec<u32>> = (0..6).map(row).collect();
    let c: Vec<&str> = translation.inputs.iter().map(|port| port.c.as_str()).collect();
    assert!(c.contains(&"m->conf->limits->high") && c.contains(&"m->table[2]"), "{c:?}");
    let found = emulated(&program, &translation, &T3, &rows).concat();
    let found: Vec<f32> = found.into_iter().map(f32::from_bits).collect();
    assert_eq!(found, [100.0, 100.5, 101.5, 103.0, 103.0, 103.0]);
    let _ = std::fs::remove_dir_all(folder);
}

#[test]
fn takes_numbers_that_hold_in_every_period() {
    let mut program = Program::new(
        "takes_numbers_that_hold_in_every_period",
        r#"struct fir { int taps; float *c; };
float step(const struct fir *f, const float *x, int n) { float s = 0.0f; for (int i = 0; i < f->taps; i++) s += f->c[i]*x[i + n]; return s; }
"#,
    );
    let folder = folder(&program.name);
    let names = |program: &Program| {
        let ports = translated(program, &folder)?.inputs;
        Ok::<_, String>(ports.into_iter().map(|port| port.c).collect::<Vec<_>>().join(" "))
    };
    assert!(names(&program).is_err());
    program.set = vec![("f->taps".to_owned(), vec![2.0]), ("n".to_owned(), vec![1.0])];
    assert_eq!(names(&program).expect("it is translated"), "x[1] x[2] f->c[0] f->c[1]");
    for (name, number, part) in [("m", 1.0, "no such scalar"), ("n", 0.5, "int does not hold it")] {
        program.set = vec![(name.to_owned(), vec![number])];
        let message = names(&program).expect_err("it is refused");
        assert!(message.contains(part), "{message}");
    }
    let _ = std::fs::remove_dir_all(folder);
}

/// The structure of a sparse matrix, as OSQP keeps it: arrays behind pointers of a structure and of the step.
#[test]
fn arrays_that_are_the_same_in_every_period() {
    let code = r#"
typedef struct { int m, n; int *p, *i; float *x; } csc;
void step(const csc *A, const float *x, float *y)
{
    for (int k = 0; k < A->m; k++) y[k] = 0;
    for (int j = 0; j < A->n; j++)
        for (int k = A->p[j]; k < A->p[j + 1]; k++) y[A->i[k]] += A->x[k]*x[j];
}
"#;
    let mut program = Program::new("arrays_that_are_the_same", code);
    program.set = [
        ("A->m", vec![2.0]),
        ("A->n", vec![3.0]),
        ("A->p", vec![0.0, 2.0, 3.0, 4.0]),
        ("A->i", vec![0.0, 1.0, 1.0, 0.0]),
    ]
    .map(|(name, numbers)| (name.to_owned(), numbers))
    .to_vec();
    let folder = folder("arrays_that_are_the_same");
    let translation = translated(&program, &folder).expect("it is translated");
    let names: Vec<&str> = translation.inputs.iter().map(|port| port.name.as_str()).collect();
    assert_eq!(
        names,
        ["x[1]", "x[2]", "x[3]", "A_x[1]", "A_x[2]", "A_x[3]", "A_x[4]"],
        "{}",
        translation.text
    );
    assert!(translation.text.contains("A_x[1]*x[1]"), "{}", translation.text);
    for (name, numbers, reason) in [
        ("A->q", vec![0.0, 1.0], "the step reads no such scalar"),
        ("A->i", vec![0.0, 0.5, 1.0, 1.0], "does not hold it"),
        ("x", vec![1.0; 5000], "at most 4096 elements"),
    ] {
        let mut wrong = program.clone();
        wrong.set.push((name.to_owned(), numbers));
        let message = translated(&wrong, &folder).expect_err("it is refused");
        assert!(message.contains(reason), "{name}: {message}");
    }
    let _ = std::fs::remove_dir_all(folder);
}

#[test]
fn computes_in_64_bits() {
    check(
        "computes_in_64_bits",
        r#"#include <stdint.h>
int step(int a, int b, unsigned c, unsigned d) {
  int64_t x = ((int64_t)a << 20) + b, y = (int64_t)a*b - x, z = -y; uint64_t u = (uint64_t)c*d + c, v = ((uint64_t)d << 32) | c;
  int r = (int)(x ^ y) + (int)((x & z) >> 13) + (int)(~z >> 32) + (int)(u >> 31) + (int)((u*v) >> 40) + (int)(v%256u) + (int)(v/1024u);
  return r + (x < y) + 2*(u < v) + 4*(x <= z) + 8*(u == v) + 16*!!y + (y > 0 ? (int)(x << 35 >> 33) : (int)(u >> 45)) + (x == a); }
"#,
    );
}

/// A clock of microseconds that goes on over the periods, and an accumulator in fixed point.
#[test]
fn keeps_states_of_64_bits() {
    check(
        "keeps_states_of_64_bits",
        r#"#include <stdint.h>
static uint64_t now, last[3]; static int64_t sum = -5;
float step(unsigned passed, int x, int i) {
  now += passed; if (x > 100) sum = 0; else sum += (int64_t)x*x; if (sum > 1000000000000) sum = 1000000000000;
  uint32_t since = (uint32_t)(now - last[i & 1]); last[(i >> 1) & 1] = now; last[2] = last[0];
  for (long long k = 0; k < 40; k++) sum += k*x;
  return (float)since + (float)(int32_t)(sum >> 16) + (last[2] >= last[1]); }
"#,
    );
}

/// The member of a union that the program uses lays it out.
#[test]
fn lays_unions_out_by_use() {
    check(
        "lays_unions_out_by_use",
        r#"#include <stdint.h>
struct control { union { struct { int16_t roll, pitch; float thrust; }; struct { float force; float torque[3]; }; float motors[4]; }; int mode; };
float step(struct control *c, float x) { c->roll = (int16_t)(c->roll + 3); c->pitch = -5; c->thrust = 0.5f*c->thrust + x; return c->thrust + c->roll; }
"#,
    );
    let message = refused(
        "refuses_a_union_in_two_ways",
        r#"union both { short a[2]; float b; };
float step(int n) {
  union both u; u.a[0] = n; u.a[1] = n;
  return u.b; }
"#,
    );
    assert!(message.contains("is read as"), "{message}");
}

#[test]
fn reads_strings() {
    check(
        "reads_strings",
        r#"static void copy(char *to, const char *from) { while ((*to++ = *from++)) {} }
const char *names[] = { "", "solved", "unsolved" };
static char name[16];
int step(int n) { copy(name, names[1]); return name[0] + name[n & 3] + "abc"[n & 1]; }
"#,
    );
}

#[test]
fn leaves_out_calls() {
    let mut program = Program::new(
        "leaves_out_calls",
        r#"extern void toggle(int pin); extern int read(int pin);
float step(float a) { toggle(3); return 2.0f*a; }
float other(float a) { return a + read(3); }
"#,
    );
    let folder = folder(&program.name);
    program.ignore = vec!["toggle".to_owned(), "read".to_owned()];
    assert!(translated(&program, &folder).is_ok());
    program.step = "other".to_owned();
    let message = translated(&program, &folder).expect_err("it is refused");
    assert!(message.contains("--ignore read"), "{message}");
    let _ = std::fs::remove_dir_all(folder);
}

#[test]
fn indexes_structures_by_value() {
    check(
        "indexes_structures_by_value",
        r#"struct vec { float x, y, z; };
float step(struct vec v, int i) { return ((const float *)&v)[(i & 3) == 3 ? 0 : i & 3]; }
"#,
    );
}

#[test]
fn leaves_loops() {
    check(
        "leaves_loops",
        r#"int step(const int x[12], int n) { int r = -1; for (int i = 0; i < 12; i++) { if (x[i] == 3) continue; if (x[i] > n) { r = i; break; } } return r; }
"#,
    );
}

#[test]
fn returns_from_loops() {
    check(
        "returns_from_loops",
        r#"static int find(const int *x, int n) { for (int i = 0; i < 40; i++) { if (x[i & 7] + i > n) return i; } return -1; }
int step(const int x[8], int n) { return find(x, n)*2; }
"#,
    );
}

#[test]
fn iterates_to_convergence() {
    check(
        "iterates_to_convergence",
        r#"float step(float x) { float a = x > 0 ? x : -x, r = 1.0f; int n;
  for (n = 0; n < 60; n++) { float next = 0.5f*(r + a/r); float d = next - r; r = next; if (d < 1e-6f && d > -1e-6f) break; }
  return r + n; }
"#,
    );
}

/// Subscripts of a loop's index that a condition guards: outside of the array in other iterations.
#[test]
fn guards_subscripts_of_counters() {
    check(
        "guards_subscripts_of_counters",
        r#"static const int at[5] = { 3, 1, 4, 1, 5 };
float step(const float x[40], int n) {
  float sum = 0;
  for (int i = 0; i < 40; i++) {
    if (i < 5) sum += x[i]*at[i];
    else if (i > 35) sum -= x[i]/at[i - 35];
    else sum = 0.5f*sum + x[i ^ (n & 3)]; }
  return sum; }
"#,
    );
}

/// More results than ports: the largest array stays in data memory.
#[test]
fn operations_name_their_lines_of_c() {
    let code = "float step(float x, float y) {\n  float s = x*y;\n  s = s +\n    x/y;\n  return s; }\n";
    let translation = check("operations_name_their_lines_of_c", code);
    let program = assembled(&translation, &takt_isa::T3).expect("it is well formed").program;
    let place = |mnemonic: &str| {
        let is_it = |word: &usize| {
            let slots = program.machine.slots.len();
            let address = takt_isa::BundleAddress::new((word / slots) as u32);
            let bundle = program.bundle(address).and_then(Result::ok);
            bundle.is_some_and(|bundle| bundle[word % slots].op.row().mnemonic == mnemonic)
        };
        let word = (0..program.code.len()).find(is_it).unwrap_or_else(|| panic!("no {mnemonic}"));
        program.word_text(word).split(" → ").next().unwrap_or_default().to_owned()
    };
    let name = "operations_name_their_lines_of_c.c";
    assert_eq!([place("fmul"), place("fdiv")], [format!("{name}:2"), format!("{name}:3")]);
}

/// Elements in data memory are read right after they are written: from numbers, from bits, and from narrow types.
#[test]
fn compares_elements_that_were_just_written() {
    check(
        "elements_just_written",
        r#"struct st { int count; int log[8]; }; static struct st s;
int step(int n) { s.log[n & 7] = n; s.count = 7; return s.count > 5 && s.log[n & 7] == n; }
"#,
    );
    check(
        "elements_just_masked",
        r#"static int x[8]; static int t[4];
int step(int n) { int i = n & 7; x[i] = (x[i] + n) & 255; t[n & 3] = ~n | 16; int a = x[i] > 99 ? 5 : 6; return a*(t[n & 3] < 0 ? 2 : 3); }
"#,
    );
    check(
        "elements_just_cut",
        r#"#include <stdint.h>
struct st { uint8_t c8; int16_t tab[4]; }; static struct st s;
int step(int n) { s.c8 += 50; s.c8 += 100; s.tab[n & 3] = (int16_t)n; return s.c8 + s.tab[n & 3] + (s.tab[n & 3] > 77); }
"#,
    );
}

/// Unsigned divisors from 2^31 on fit once or not.
#[test]
fn divides_by_unsigned_numbers_from_2_to_the_31_on() {
    check(
        "wide_divisors",
        "unsigned step(unsigned a, int n) {\n\
         unsigned b = a | 0x80000000u;\n\
         return a / 0x80000000u + 3*(a / 0xffffffffu) + 5*(a / 0xc0000001u) + a % 0xfffffff0u + 7*(n / 0x90000000u)\n\
         + 11*(b / 0x80000001u) + b % 0x80000001u;\n}\n",
    );
}

/// The body of a loop changes what its counter is compared with, and an iteration that is written out has a counter beyond a narrow type.
#[test]
fn bounds_loops_by_every_iteration() {
    let code = "static int t[8] = { 3, -4, 500, -600, 7, 8, 9, 10 };\n\
                int step(int n, int m) {\n  int w = 0, k = 0;\n\
                for (int i = 0; i < ((2 - w) & 7); i++) {\n\
                for (int j = 0; j < 40; j++) { w ^= (n >> (j & 31)) + t[(w + j) & 7]; k += w & m; }\n    k++;\n  }\n  return k;\n}\n";
    let text = check("ends_that_change", code).text;
    assert!(text.contains(".loop_bound 7\n"), "{text}");
    check(
        "narrow_counters",
        "int step(int n) { int c = 7; for (int v = 1; v <= 146; v += 2) c -= (((signed char)v / 4) ^ n) >> 19; return c & 255; }\n",
    );
}

/// The body of a loop counts down what the step counts up: nothing bounds the loop.
#[test]
fn refuses_a_counter_that_the_body_changes() {
    let code = "static int t[8];\nint step(int n) {\n  int w = 0;\n\
                for (int i = 0; i < 9; i++) {\n\
                for (int j = 0; j < 40; j++) w ^= (n >> (j & 31)) + t[(w + j) & 7];\n    if (w & 1) i--;\n  }\n  return w;\n}\n";
    let text = refused("changed_counter", code);
    assert!(text.contains("no bound is known"), "{text}");
}

/// A member that data index lies in data memory with its own name and type; the others are registers.
#[test]
fn only_members_that_data_index_lie_in_memory() {
    let code = "struct st { float gain; int count; float hist[8]; struct { int a, b; } in; };\n\
                float step(struct st *s, float x, int n) { s->hist[n & 7] = x; s->count++; s->in.a += n;\n\
                return s->gain*s->hist[(n + 1) & 7] + s->count + s->in.a; }\n";
    let text = check("members_of_a_structure", code).text;
    for line in [".array  s_hist[8]\n", ".state  s_count:int\n", ".state  s_in_a:int\n", ".input  s_gain"] {
        assert!(text.contains(line), "no {line:?} in\n{text}");
    }
    check(
        "members_beside_narrow_ones",
        r#"#include <stdint.h>
struct in { int16_t lead; float taps[4]; int8_t tail; };
struct st { int8_t a; int16_t b, c; struct in in; float last; int grid[2][3]; struct { float x; int8_t n; } pair[3]; };
static struct st s;
float step(int n, float x)
{
    int i = n & 3, j = n & 1, k = (n & 7) % 3;
    s.a += 3; s.b += s.a; s.c -= n; s.in.lead += 2; s.in.tail++;
    s.in.taps[i] = x; s.grid[j][k] += n; s.pair[k].x += x; s.pair[2 - k].n += 5; s.last = x;
    const float *q = s.in.taps + 4;
    return s.in.taps[3 - i] + q[-1 - i] + s.grid[1][k] + s.pair[k].x + s.pair[j].n + s.a + s.b + s.c + s.in.lead + s.in.tail + s.last;
}
"#,
    );
    check(
        "pointers_into_a_member",
        r#"struct st { int n; float a[6]; int m; float b[6]; };
static struct st s;
float step(int n, float x)
{
    float *p = n & 1 ? s.a : s.a + 2, *end = s.b + 6, sum = 0;
    p[n & 3] = x; s.n++; s.m += s.n;
    for (float *q = s.b; q < end; q++) *q += x*s.n;
    if (n & 2) p = &s.a[1];
    for (int i = 0; i < (n & 3); i++) sum += *p++;
    return sum + s.b[n & 3] + s.m;
}
"#,
    );
    check(
        "copies_of_members",
        r#"#include <string.h>
struct f { float z[4]; int at; }; struct st { struct f f; float gain; };
static struct st s; static struct f saved;
static float filter(struct f *f, float x) { f->z[f->at] = x; f->at = (f->at + 1) & 3; float y = 0; for (int i = 0; i < 4; i++) y += f->z[(f->at + i) & 3]*(i + 1); return y; }
float step(int n, float x)
{
    struct f t = s.f;
    if (n == 3) memcpy(&saved, &s.f, sizeof saved);
    if (n == 5) s.f = saved;
    s.gain = filter(&t, x);
    return s.gain + filter(&s.f, -x) + saved.z[n & 3];
}
"#,
    );
}

/// Copies reach as far as they say: of elements that data choose, and behind pointers of unknown length.
#[test]
fn copies_what_data_choose_and_all_of_it() {
    check(
        "copies_of_chosen_elements",
        r#"#include <stdint.h>
#include <string.h>
struct e { uint8_t k[4]; float v[2]; };
static struct { int16_t win[5]; int8_t pos; } m[3];
static struct { float x; struct e t[8]; } g;
float step(int n, float x)
{
    int16_t t[5];
    m[(n & 7) % 3].win[2] = n; m[1].pos++;
    memcpy(t, m[(n & 7) % 3].win, sizeof t);
    g.t[n & 7].v[1] += x; g.t[(n + 1) & 7].k[2] = 3;
    if (n & 8) memset(&g.t[n & 3], 0, sizeof(struct e));
    return t[2] + t[3] + g.t[n & 3].v[1] + g.t[n & 7].k[2] + m[1].pos;
}
"#,
    );
    let code = "#include <string.h>\nvoid step(const float *x, float *y) { float t[4]; memcpy(t, x, sizeof t); memset(y, 0, 3*sizeof *y); y[0] = t[0] + t[3]; }\n";
    let translation = check("copies_behind_pointers", code);
    assert_eq!([translation.inputs.len(), translation.outputs.len()], [2, 3], "{}", translation.text);
    let code = "#include <string.h>\nfloat step(float x) { float t[4] = { x }, u[2]; memcpy(u, t + 3, sizeof u); return u[0]; }\n";
    let text = refused("copies_beyond_an_end", code);
    assert!(text.contains("beyond the end of `t`, at byte 16"), "{text}");
}

/// Faults that a stranger's programs found: an unsigned quotient by a number that is 1 by computation, pointers chosen among structures of
/// several types, and structures that change places.
#[test]
fn chosen_pointers_quotients_by_one_and_exchanges() {
    check(
        "quotient_by_a_computed_one",
        "int step(short a, unsigned n) { unsigned t = (unsigned)a/((n & 0) + 1u); return (128 < t) + (t >> 5 > 7)*2 + (t/7u > 99)*4; }\n",
    );
    check(
        "chosen_elements_of_several_types",
        r#"#include <stdint.h>
typedef struct { float z[2]; int16_t x[8]; } E; static E t[4];
int step(int c, int h) { int16_t *px = c & 1 ? t[1].x : t[c & 3].x; px[h & 7] += c; return px[(h >> 2) & 7]; }
"#,
    );
    check(
        "chosen_members_of_several_types",
        r#"#include <stdint.h>
typedef struct { uint8_t k; float x[4]; } E; static struct { uint16_t n; E one; E t[2]; } g;
float step(int a, int b, float f) { E *p = a > b ? &g.one : &g.t[b & 1]; p->x[a & 3] += f; p->k++; return g.one.x[b & 3] + g.one.k; }
"#,
    );
    let code = "typedef struct { float v[40]; } O; static O g, h;\n\
                float step(int i, float f) { { O t = g; g = h; h = t; } g.v[3] += f; g.v[7] -= i; float o = 0;\n\
                for (int k = 0; k < 40; k++) o += g.v[k]; return o; }\n";
    check("large_structures_exchanged", code);
    let code = "static unsigned char bytes[12], len; static int sum(const unsigned char *p, unsigned char n) { int a = 0; while (n--) a += *p++; return a; }\n\
                int step(unsigned char x) { if (len < 12) bytes[len++] = x; return sum(bytes, len); }\n";
    let text = refused("a_walk_without_bound", code);
    assert!(text.contains("loop_bound(N)"), "{text}");
    check(
        "a_walk_with_a_loose_bound",
        &code.replace("int a = 0;", "int a = 0;\n#pragma takt loop_bound(20)\n"),
    );
    let code = "static struct { unsigned char pre; short hist[32]; int c; } d; int step(unsigned char k, short h) { d.hist[k & 31] = h; d.c++; int s = 0;\n\
                short *p = d.hist, *e = d.hist + (k & 31);\n#pragma takt loop_bound(31)\nwhile (p < e) s += *p++; return s + d.c; }\n";
    check("a_walk_to_an_end_that_data_choose", code);
    let code = "static int v[4]; int step(int n) { int s = 0; for (int i = 0; i < 6; i++) s += v[i]; v[n & 3] = n; return s; }\n";
    let text = refused("a_walk_beyond_an_end", code);
    assert!(text.contains("this is outside of `v`") && text.contains("loop_bound(N)"), "{text}");
}

/// A pointer that may lead to two members takes the whole structure into data memory; the source says which word is which member.
#[test]
fn lists_the_members_of_a_structure_in_memory() {
    let code = "struct st { float gain; int count; float a[4], b[4]; }; static struct st s;\n\
                float step(float x, int n) { float *p = n > 3 ? s.a : s.b; p[n & 3] = x; s.count++; s.gain += x;\n\
                return s.gain + s.count + s.a[(n + 1) & 3] + s.b[n & 1]; }\n";
    let text = check("members_of_a_whole_structure", code).text;
    assert!(text.contains("; Words of s: 1 gain, 2 count, 3 to 6 a, 7 to 10 b.\n"), "{text}");
    let code = "struct v { float x, y, z; int n; }; float step(struct v *v, float a, int i) { ((float *)v)[i & 1] = a; v->n++; return v->x - v->y + v->n; }\n";
    check("members_through_the_first", code);
}

/// Pointers have as many elements as the step uses, however the elements are found out.
#[test]
fn pointers_have_as_many_elements_as_are_used() {
    let sizes = |name: &str, code: &str| {
        let translation = check(name, code);
        [translation.inputs.len(), translation.outputs.len()]
    };
    let code = "void step(const float *x, float *y) { for (int i = 0; i < 3; i++) y[i] = x[i + 1]; }\n";
    assert_eq!(sizes("pointers_in_a_loop", code), [3, 3]);
    assert_eq!(
        sizes("pointers_by_numbers", "float step(const float *x) { return x[0] + x[1] + x[7]; }\n"),
        [3, 1]
    );
    let code = "struct p { float a, b; }; float step(const struct p *p, int n) { float s = 0; for (int i = 0; i < 5; i++) s += p[i].b; return s + p[n & 7].a; }\n";
    assert_eq!(sizes("pointers_to_structures", code), [17, 1]);
}

/// Iterations that are left over when a loop is unrolled are written out, with numbers in place of the counter.
#[test]
fn divides_counters() {
    let translation = check(
        "divides_counters",
        r#"static float t[64];
static int n[128];
float step(float x, int k) {
  t[k & 63] += x;
  for (int i = 701; i > 0; i--) t[(i / 4) & 63] += x*t[i % 4 + 1];
  for (int i = -701; i < 700; i++) n[i & 127] += i / 4 + (i % 4)*k + i / -8 + (i << 30) + (int)((unsigned)i << 31);
  float s = 0;
  for (int i = 0; i < 83; i++) s += n[i]*t[i / 2];
  return s; }
"#,
    );
    assert!(translation.text.contains("unroll"), "{}", translation.text);
}

#[test]
fn keeps_many_results_in_memory() {
    let translation = check(
        "keeps_many_results_in_memory",
        r#"struct parts { float low, high; };
void step(float x, float y[40], float *sum, struct parts *p) {
  float s = 0;
  for (int i = 0; i < 40; i++) y[i] = x*i + 1.0f;
  for (int i = 0; i < 40; i++) s += y[i];
  *sum = s; p->low = y[0]; p->high = y[39]; }
"#,
    );
    let names: Vec<&str> = translation.outputs.iter().map(|port| port.name.as_str()).collect();
    assert_eq!(names, ["sum", "p_low", "p_high"]);
    assert!(translation.text.contains(".array  y[40]\n.result y"), "{}", translation.text);
    let message = refused(
        "refuses_many_results_apart",
        &format!(
            "struct all {{ float {}; }};\nvoid step(struct all *a, float x) {{ {} }}\n",
            (0..33).map(|i| format!("m{i}")).collect::<Vec<_>>().join(", "),
            (0..33).map(|i| format!("a->m{i} = x*{i};")).collect::<String>()
        ),
    );
    assert!(message.contains("33 outputs"), "{message}");
}

/// A pointer that changes in a loop that stays a loop, and what it points to: known within an iteration, lost between iterations.
#[test]
fn loses_pointers_between_iterations() {
    check(
        "loses_pointers_between_iterations",
        r#"float step(float x, int n) {
  float a[3] = { x, 1.0f, 2.0f }, b[3] = { 4.0f, x, 5.0f };
  const char *said = 0; float sum = 0;
  for (int i = 0; i < 500 && i < n; i++) {
    const float *p = (i & 1) ? a : a + 1;
    said = "even"; sum = 0.5f*sum + *p;
    p = b; sum += p[2]*0.125f;
    if (sum > 100.0f) said = "large";
  }
  return sum; }
"#,
    );
    let message = refused(
        "refuses_a_lost_pointer",
        r#"float step(float x, int n) {
  float a = x, b = 2.0f*x, sum = 0; float *p = &a;
  for (int i = 0; i < 500 && i < n; i++) {
    sum = 0.5f*sum + *p;
    p = &b; }
  return sum; }
"#,
    );
    for part in [":4:", "`p` is a pointer to several objects in a loop"] {
        assert!(message.contains(part), "{message}");
    }
}

/// Objects of a call end with it: others take their places, and pointers to them are known to point nowhere.
#[test]
fn forgets_variables_of_calls() {
    check(
        "forgets_variables_of_calls",
        r#"static const float *kept; static const char *text;
static float f(float x) { float a[4] = { x, 1, 2, 3 }; kept = a; if (x > 0) text = "plus"; else text = "minus"; return kept[1] + a[0]; }
static float g(float x) { float b[4] = { 7, x, 8, 9 }; for (int i = 0; i < 4; i++) b[i] *= x; return b[1] + b[3]; }
float step(float x, float y) { float r = f(x); if (y > 0) r += g(y); else r -= f(y) + g(x); return r + f(r); }
"#,
    );
    let message = refused(
        "refuses_a_pointer_that_dangles",
        r#"static int *f(int x) { int a = x; return &a; }
int step(int x) {
  int *p = f(x);
  return *p; }
"#,
    );
    for part in [":3:", "a variable of a function that has returned"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn switches() {
    check(
        "switches",
        r#"enum mode { OFF, RAMP = 3, RUN };
static enum mode mode; static int t;
float step(int key, float x) { float y = 0;
  switch (mode) { case OFF: if (key > 100) mode = RAMP; y = -1; break; case RAMP: t++; if (t > 3) { mode = RUN; t = 0; } y = x*0.5f; break; case RUN: y = x; if (key < -100) mode = OFF; break; }
  switch (key & 7) { case 1: y += 1; case 2: y += 2; break; case 5: case 6: y = 10; break; default: y -= 0.5f; }
  return y; }
"#,
    );
}

#[test]
fn wraps_integers() {
    check(
        "wraps_integers",
        r#"int step(int a, int b, unsigned c) { int r = a*7 - b; unsigned u = c*5u + 3u; short s = (short)(a + b); unsigned char k = (unsigned char)(a - b); signed char h = (signed char)b;
  r ^= (int)(u >> 3); r += s*3 + k - h; r = r << 2 | (r & 3); return (r >> 5) + (u < c) + ~a; }
"#,
    );
}

#[test]
fn multiplies_integers() {
    check(
        "multiplies_integers",
        r#"int step(int a, int b, unsigned c) { short s = (short)a, t = (short)b; return a*b + s*t*3 + (int)(c*c); }
"#,
    );
}

#[test]
fn divides_by_powers_of_two() {
    check(
        "divides_by_powers_of_two",
        r#"int step(int a, unsigned b) { return a/8 + a%16 - a/-4 + (int)(b/32u) + (int)(b%64u); }
"#,
    );
}

#[test]
fn converts() {
    check(
        "converts",
        r#"int step(float x, int n, unsigned u) { int a = (int)x; unsigned char b = (unsigned char)(int)x; float f = (float)n + (float)u*0.5f; short s = (short)n; return a + b + (int)(f*1e-3f) + s + (x ? 1 : 0) + (_Bool)n; }
"#,
    );
}

#[test]
fn puns_through_unions() {
    check(
        "puns_through_unions",
        r#"union u { float f; unsigned i; };
float step(float x) { union u v; v.f = x; v.i = (v.i & 0x7fffffffu) | 0x400000u; return v.f; }
"#,
    );
}

#[test]
fn copies_memory() {
    check(
        "copies_memory",
        r#"#include <string.h>
struct s { float a[3]; int n; };
static struct s keep;
float step(const struct s *in) { struct s t; memcpy(&t, in, sizeof t); float r = keep.a[0] + keep.n; memcpy(&keep, &t, sizeof(keep)); memset(&t, 0, sizeof t); return r + t.a[1]; }
"#,
    );
}

#[test]
fn walks_by_pointers() {
    check(
        "walks_by_pointers",
        r#"static const float c[5] = { 1, 2, 3, 4, 5 };
float step(const float x[5]) { const float *p = x, *q = c; float s = 0; while (p < x + 5) s += *p++ * *q++; float z[4]; float *w = z; *w++ = s; *w++ = s*2; *w = 1; z[3] = w[-1] + *w; return z[3] - (float)(w - z); }
"#,
    );
}

#[test]
fn jumps_forward() {
    check(
        "jumps_forward",
        r#"int step(int a, int b) { int r = 0; if (a > 5) goto out; r = b; if (b > 5) goto out; r += 100; out: return r + 1; }
"#,
    );
}

#[test]
fn takes_least_and_greatest() {
    check(
        "takes_least_and_greatest",
        r#"#include <math.h>
float step(float a, float b) { return fminf(a, b)*3.0f + fmaxf(a, 1.5f) + fminf(-0.5f, b) + fabsf(a) + copysignf(2.0f, b); }
"#,
    );
}

#[test]
fn rounds() {
    check(
        "rounds",
        r#"#include <math.h>
float step(float x) { return floorf(x) + 10.0f*ceilf(x) + 100.0f*truncf(x) + 1000.0f*roundf(x) + (float)lrintf(x) + fmodf(x, 0.7f); }
"#,
    );
}

#[test]
fn knows_not_a_number() {
    check(
        "knows_not_a_number",
        r#"#include <math.h>
int step(float a, float b) { float q = a/b; return isnan(q) + 2*(isinf(q) != 0) + 4*(isfinite(q) != 0) + 8*(signbit(q) != 0) + 16*(q == q) + 32*(q < 1.0f); }
"#,
    );
}

#[test]
fn computes_tables_while_translating() {
    check(
        "computes_tables_while_translating",
        r#"#include <stdint.h>
static uint32_t crc[16];
static void fill(void) { for (uint32_t n = 0; n < 16; n++) { uint32_t c = n << 28; for (int k = 0; k < 4; k++) c = c & 0x80000000u ? c << 1 ^ 0x04c11db7u : c << 1; crc[n] = c; } }
uint32_t step(uint32_t x) { fill(); uint32_t c = 0xffffffffu; for (int i = 28; i >= 0; i -= 4) c = c << 4 ^ crc[(c >> 28 ^ x >> i) & 15]; return c; }
"#,
    );
}

#[test]
fn calls_through_known_pointers() {
    check(
        "calls_through_known_pointers",
        r#"static float twice(float x) { return 2*x; }
static float half(float x) { return 0.5f*x; }
typedef float (*law)(float);
static const law laws[2] = { twice, half };
float step(float x) { float y = 0; for (int i = 0; i < 2; i++) y += laws[i](x); return y; }
"#,
    );
}

#[test]
fn reads_double_as_float() {
    check(
        "reads_double_as_float",
        r#"#include <math.h>
double step(double x, float y) { double a = 0.1; return a*x + 1.0/3*y + sqrt(fabs(x)) + M_PI; }
"#,
    );
}

#[test]
fn knows_64_bits() {
    check(
        "knows_64_bits",
        r#"#include <stdint.h>
static const int64_t order[3] = { 2, 0, 1 };
float step(const float x[3]) { float s = 0; for (int64_t k = 0; k < 3; ++k) s = 2*s + x[order[k]]; return s; }
"#,
    );
}

#[test]
fn writes_fields_on_some_paths() {
    check(
        "writes_fields_on_some_paths",
        r#"struct out { float u; int mode; };
void step(float x, struct out *out) { if (x > 0.0f) out->u = x; if (x > 1.0f) out->mode = 1; else if (x < -1.0f) out->mode = 2; }
"#,
    );
}

#[test]
fn branches_over_long_sides() {
    check(
        "branches_over_long_sides",
        r#"#include <math.h>
static float state;
float step(float x, int n) { float y = 0; if (n > 0) { float a = x; for (int i = 0; i < 12; i++) a = a*0.5f + sqrtf(fabsf(a) + i); state = a; y = a; } else { state = state*0.9f; for (int i = 0; i < 10; i++) y += state*x + i; if (x > 0) return y; } return y + state + 1; }
"#,
    );
}

#[test]
fn nests_data_loops() {
    check(
        "nests_data_loops",
        r#"int step(int n, int m) { int r = 0; n = n & 7; m = m & 7;
  for (int i = 0; i < 8; i++) { if (i >= n) break; for (int j = 0; j < 9 && j < m; j++) { r += i*j + 1; if (r > 60) return -r; } } return r; }
"#,
    );
}

#[test]
fn stores_under_conditions() {
    check(
        "stores_under_conditions",
        r#"static float a[6];
float step(int i, float x) { if (x > 0 && i >= 0 && i < 6) a[i] = x; if (i > 2) for (int k = 0; k < 6; k++) if (k == (i & 3)) a[k] += 1; float s = 0; for (int k = 0; k < 6; k++) s += a[k]; return s; }
"#,
    );
}

#[test]
fn indexes_structures_by_data() {
    check(
        "indexes_structures_by_data",
        r#"struct ch { float gain; int count; float z[2]; };
static struct ch ch[4] = { { 1.0f, 0, { 0, 0 } }, { 2.0f }, { .gain = 0.5f, .z[1] = 3 }, { 4.0f, 2 } };
float step(int n, float x) { struct ch *c = &ch[n & 3]; c->count++; c->z[1] = c->z[0]; c->z[0] = x; return c->gain*c->z[1] + c->count; }
"#,
    );
}

#[test]
fn initialises() {
    check(
        "initialises",
        r#"struct p { int a; struct { float x, y; } q[2]; char s[4]; };
static const struct p p = { .q = { { 1, 2 }, [1].y = 5 }, .a = 3, .s = "ab" };
static const int n[] = { [3] = 7, 8, [0] = 1 };
int step(int x) { struct p r = p; r.q[0].x += x; return (int)(r.q[0].x + r.q[1].y) + p.s[1] + (int)(sizeof n/sizeof n[0]) + n[4] + r.s[3]; }
"#,
    );
}

#[test]
fn counts_modes_in_small_integers() {
    check(
        "counts_modes_in_small_integers",
        r#"typedef unsigned char u8; typedef unsigned short u16;
static u8 n = 250; static u16 m = 65530; static signed char k = 120;
int step(int x) { n++; m += 3; k = k + 1; n += x > 0; return n + 1000*(m & 7) + k; }
"#,
    );
}

#[test]
fn evaluates_effects_in_order() {
    check(
        "evaluates_effects_in_order",
        r#"int step(int a, int b) { int i = 0, r[4] = { 0 }; r[i++] = a; r[i++] = b; r[i] = i; int x = (i += 2, i*3); int y = a > b ? r[0]++ : --r[1]; return r[0] + 10*r[1] + 100*r[2] + x + y - (i--); }
"#,
    );
}

#[test]
fn repeats_do_while() {
    check(
        "repeats_do_while",
        r#"int step(unsigned x) { int n = 0; x &= 0xffff; 
#pragma takt loop_bound(16)
 do { n += x & 1; x >>= 1; } while (n < 20 && x); 
 return n; }
"#,
    );
}

#[test]
fn refuses_recursion() {
    let message = refused(
        "refuses_recursion",
        r#"static int f(int n) { return n ? f(n - 1) : 0; }
int step(int n) { return f(n); }
"#,
    );
    for part in [":1:", "calls itself", "loop"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn refuses_a_double() {
    let message = refused(
        "refuses_a_double",
        r#"float step(float x) {
  double d = x;
  return d; }
"#,
    );
    for part in [":2:", "double", "--double=float"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn refuses_arithmetic_in_double() {
    let message = refused(
        "refuses_arithmetic_in_double",
        r#"float step(float x) {
  return 0.5*x; }
"#,
    );
    for part in [":2:", "double", "1.5f"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn refuses_loops_without_bound() {
    let message = refused(
        "refuses_loops_without_bound",
        r#"float step(float x) {
  while (x > 1.0f)
    x *= 0.5f;
  return x; }
"#,
    );
    for part in [":2:", "#pragma takt loop_bound", "--loop-bound"] {
        assert!(message.contains(part), "{message}");
    }
    let mut program = Program::new(
        "bounds_loops_by_an_option",
        r#"float step(float x) { while (x > 1.0f) x *= 0.5f; return x; }
"#,
    );
    program.loop_bound = Some(12);
    let folder = folder(&program.name);
    let text = translated(&program, &folder).expect("it is translated").text;
    assert!(text.contains(".loop_bound 12\n"), "{text}");
    let _ = std::fs::remove_dir_all(folder);
}

#[test]
fn refuses_unknown_calls() {
    let message = refused(
        "refuses_unknown_calls",
        r#"float step(float x) {
  return HAL_Read(3) + x; }
"#,
    );
    for part in [":2:", "HAL_Read"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn refuses_division_by_zero() {
    let message = refused(
        "refuses_division_by_zero",
        r#"int step(int a) {
  return a/(3 - 3); }
"#,
    );
    for part in [":2:", "division by zero"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn refuses_malloc() {
    let message = refused(
        "refuses_malloc",
        r#"#include <stdlib.h>
int step(int a) {
  int *p = malloc(4); *p = a; return *p; }
"#,
    );
    for part in [":3:", "malloc"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn refuses_jumps_back() {
    let message = refused(
        "refuses_jumps_back",
        r#"int step(int a) { again: a--; if (a > 0) goto again; return a; }
"#,
    );
    assert!(message.contains("goto again"), "{message}");
}

/// Translation takes a time in the length of such chains, not in the number of paths through them.
#[test]
fn long_chains_of_a_counter() {
    let chain = "j = j ^ (j << 1); ".repeat(40);
    check(
        "long_chains_of_a_counter",
        &format!(
            "static float t[8]; float step(float x) {{ float a = x; {}\nfor (int i = 0; i < 500; i++) {{ int j = i; {chain} t[j & 7] += a; }} return t[3] + a; }}\n",
            "a = 0.5f*a; a = 1.5f*a; ".repeat(20)
        ),
    );
}

#[test]
fn refuses_indices_outside() {
    let message = refused(
        "refuses_indices_outside",
        r#"int step(int a) {
  int x[3] = { a };
  return x[3]; }
"#,
    );
    for part in [":3:", "outside"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn refuses_unset_values() {
    let message = refused(
        "refuses_unset_values",
        r#"int step(int a) {
  int x;
  return x + a; }
"#,
    );
    for part in [":3:", "before it is written"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn refuses_division_of_64_bits() {
    let message = refused(
        "refuses_division_of_64_bits",
        r#"int step(int a) {
  long long x = a;
  return (int)(x/3); }
"#,
    );
    for part in [":3:", "64-bit"] {
        assert!(message.contains(part), "{message}");
    }
}

/// Ports have 32 bits: an integer of 64 bits is two of them.
#[test]
fn splits_64_bits_at_ports() {
    let program = Program::new(
        "splits_64_bits_at_ports",
        "long long step(unsigned long long a, int b) { return a + b; }\n",
    );
    let folder = folder(&program.name);
    let translation = translated(&program, &folder).expect("it is translated");
    let names = |ports: &[takt_front::c::Port]| {
        ports.iter().map(|port| port.name.clone()).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(names(&translation.inputs), "a_low a_high b");
    assert_eq!(names(&translation.outputs), "step_low step_high");
    let rows: Vec<Vec<u32>> = [[u32::MAX, 7, 1], [5, 0, -6_i32 as u32]].map(Vec::from).into();
    assert_eq!(emulated(&program, &translation, &T3, &rows), [[0, 8], [u32::MAX, u32::MAX]]);
    let _ = std::fs::remove_dir_all(folder);
}

#[test]
fn refuses_null() {
    let message = refused(
        "refuses_null",
        r#"int step(int a) {
  int *p = 0;
  return *p + a; }
"#,
    );
    for part in [":3:", "null"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn tells_a_missing_header() {
    let message = refused(
        "tells_a_missing_header",
        r#"#include <nowhere.h>
int step(int a) { return a; }
"#,
    );
    for part in ["nowhere.h", "math.h"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn tells_a_syntax_error() {
    let message = refused(
        "tells_a_syntax_error",
        r#"int step(int a) {
  return a +; }
"#,
    );
    assert!(message.contains(":2:"), "{message}");
}

#[test]
fn tells_a_missing_function() {
    let message = refused(
        "tells_a_missing_function",
        r#"int stop(int a) { return a; }
"#,
    );
    assert!(message.contains("stop"), "{message}");
}

#[test]
fn tells_that_there_is_no_function() {
    let message = refused("tells_that_there_is_no_function", "int kp;\n");
    assert!(message.ends_with("the files define no function"), "{message}");
}

#[test]
fn messages_of_the_preprocessor_are_the_users() {
    let message = refused("messages_of_the_preprocessor_are_the_users", "#include \"nope.h\"\n");
    assert!(!message.contains("redefined") && !message.contains("<command-line>"), "{message}");
}

#[test]
fn a_folder_is_no_c_file() {
    let preprocessor = takt_front::c::Preprocessor::new(&[]).expect("a folder");
    let Err(error) = preprocessor.run(std::path::Path::new("/")) else { panic!("a folder is read") };
    assert!(error.to_string().contains("a folder, not a C file"), "{error}");
}
