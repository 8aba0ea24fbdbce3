//! The expression language of the scene file: loads, tensions, boundary values and exact fields as formulas of the
//! position.
//!
//! A formula is parsed by a Pratt parser that knows where every byte came from, kept as a graph in which equal
//! subexpressions are one node, and compiled to a short list of instructions that run over blocks of points.
//!
//! ```
//! use expression::{Expression, Scope, Variable};
//!
//! let mut scope = Scope::new();
//! scope.define("g", 0.05)?;
//! let load = Expression::parse("if(x^2 + y^2 < 0.5, -10*g, -8*g)", &scope)?;
//! let mut out = [0.0; 2];
//! load.eval(&[0.1, 0.9], &[0.0, 0.9], &[], &mut out);
//! assert_eq!(out, [-0.5, -0.4]);
//!
//! let slope = Expression::parse("x^3*y", &scope)?.derivative(Variable::X);
//! assert_eq!(slope.eval_at(2.0, 5.0, 0.0), 60.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The language
//!
//! | what | written | binds |
//! |---|---|---|
//! | or | `a \|\| b` | loosest, to the left |
//! | and | `a && b` | to the left |
//! | comparison | `< <= > >= == !=` | does not chain |
//! | sum | `a + b`, `a - b` | to the left |
//! | product | `a*b`, `a/b` | to the left |
//! | sign, not | `-a`, `+a`, `!a` | tighter than a product: `-x^2` is `-(x^2)` |
//! | power | `a^b` | tightest, to the right: `2^3^2` is 512 |
//!
//! Names: `x`, `y`, `region`, `pi`, `e` and the parameters of the [`Scope`]. Functions: `sin cos tan asin acos atan
//! atan2 sinh cosh tanh exp ln log log10 sqrt cbrt abs sign min max hypot floor ceil step` and `if(condition, then,
//! else)`; `log` is `ln`, `min` and `max` take two or more arguments, `step(t)` is 1 for `t > 0` and else 0, `sign(0)`
//! is 0.
//!
//! A true comparison is 1, a false one 0; every value but 0 counts as true (so a NaN does). `if`, `&&` and `||`
//! evaluate only what they need: what is wrong in a branch not taken never shows. A comparison with a NaN is false but
//! for `!=`, `step` of a NaN is 0, and every other function, `min` and `max` included, hands a NaN on.
//!
//! # Rounding
//!
//! Operations are the IEEE ones, in the order written: nothing is reassociated, no product and sum are fused, and a
//! quotient by a constant is made of products only where these have its bits. A power with a constant integer exponent up to 1024 in size is made of products only
//! (`x^-n` is `1/x^n`). So a formula built of sums, products, quotients and such powers gives results scaled exactly
//! when its inputs are scaled by powers of two. A batch gives the same bits as its points one by one.

mod compile;
mod derive;
mod dispatch;
mod error;
mod eval;
mod expression;
mod function;
mod graph;
mod loops;
mod lower;
mod names;
mod parser;
mod program;
mod quotient;
mod registers;
mod scope;
mod share;
mod term;
mod token;
mod wide;

pub use error::{ParseError, ScopeError};
pub use expression::{Expression, Joint, Variable};
pub use scope::Scope;
