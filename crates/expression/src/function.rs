//! The operations: their names, and the one place that says what each computes.

/// Operations of one operand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Unary {
    Neg,
    Not,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Ln,
    Log10,
    Sqrt,
    Cbrt,
    Abs,
    Sign,
    Floor,
    Ceil,
    Step,
}

/// Operations of two operands. `And` and `Or` leave the right operand alone when the left one decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    Pow,
    Lt,
    Le,
    Gt,
    Ge,
    Eq,
    Ne,
    And,
    Or,
    Min,
    Max,
    Hypot,
    Atan2,
}

impl Unary {
    /// The value, for one operand.
    #[inline(always)]
    pub(crate) fn apply(self, a: f64) -> f64 {
        match self {
            Self::Neg => -a,
            Self::Not => truth(a == 0.0),
            Self::Sin => a.sin(),
            Self::Cos => a.cos(),
            Self::Tan => a.tan(),
            Self::Asin => a.asin(),
            Self::Acos => a.acos(),
            Self::Atan => a.atan(),
            Self::Sinh => a.sinh(),
            Self::Cosh => a.cosh(),
            Self::Tanh => a.tanh(),
            Self::Exp => a.exp(),
            Self::Ln => a.ln(),
            Self::Log10 => a.log10(),
            Self::Sqrt => a.sqrt(),
            Self::Cbrt => a.cbrt(),
            Self::Abs => a.abs(),
            Self::Sign => {
                if a == 0.0 || a.is_nan() {
                    a
                } else {
                    1.0f64.copysign(a)
                }
            }
            Self::Floor => a.floor(),
            Self::Ceil => a.ceil(),
            Self::Step => truth(a > 0.0),
        }
    }

    /// Whether the value is always 0 or 1.
    pub(crate) fn is_truth(self) -> bool {
        matches!(self, Self::Not | Self::Step)
    }

    /// Whether a processor does it in an instruction or two, without a call.
    pub(crate) fn is_cheap(self) -> bool {
        matches!(
            self,
            Self::Neg | Self::Not | Self::Abs | Self::Sign | Self::Step
        )
    }
}

impl Binary {
    /// The value, for two operands. A power with a constant integer exponent is not computed here but by
    /// [`integer_power`].
    #[inline(always)]
    pub(crate) fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Sub => a - b,
            Self::Mul => a * b,
            Self::Div => a / b,
            Self::Pow => a.powf(b),
            Self::Lt => truth(a < b),
            Self::Le => truth(a <= b),
            Self::Gt => truth(a > b),
            Self::Ge => truth(a >= b),
            Self::Eq => truth(a == b),
            Self::Ne => truth(a != b),
            Self::And => truth(a != 0.0 && b != 0.0),
            Self::Or => truth(a != 0.0 || b != 0.0),
            Self::Min => {
                if a < b || a.is_nan() {
                    a
                } else {
                    b
                }
            }
            Self::Max => {
                if a > b || a.is_nan() {
                    a
                } else {
                    b
                }
            }
            Self::Hypot => a.hypot(b),
            Self::Atan2 => a.atan2(b),
        }
    }

    /// Whether the operands may be exchanged without a change of the value's bits.
    pub(crate) fn commutes(self) -> bool {
        matches!(self, Self::Add | Self::Mul | Self::Eq | Self::Ne)
    }

    /// Whether the value is always 0 or 1.
    pub(crate) fn is_truth(self) -> bool {
        self.is_comparison() || matches!(self, Self::And | Self::Or)
    }

    pub(crate) fn is_comparison(self) -> bool {
        matches!(
            self,
            Self::Lt | Self::Le | Self::Gt | Self::Ge | Self::Eq | Self::Ne
        )
    }

    /// Whether a processor does it in an instruction or two, without a call.
    pub(crate) fn is_cheap(self) -> bool {
        !matches!(self, Self::Pow | Self::Hypot | Self::Atan2)
    }
}

#[inline(always)]
fn truth(value: bool) -> f64 {
    if value { 1.0 } else { 0.0 }
}

/// Largest size of a constant integer exponent that is worked out by products.
pub(crate) const LARGEST_POWER: u32 = 1024;

/// The exponent as an integer, when its power is to be made of products.
pub(crate) fn integer_exponent(exponent: f64) -> Option<i32> {
    let small = exponent.abs() <= f64::from(LARGEST_POWER) && exponent.trunc() == exponent;
    small.then_some(exponent as i32)
}

/// `base^exponent` by repeated squaring, least significant bit first: `x^6 = x^2*x^4`, `x^-n = 1/x^n`. `multiply` and
/// `invert` say in which arithmetic; none stands for 1, the power zero.
pub(crate) fn integer_power<T: Copy>(
    base: T,
    exponent: i32,
    mut multiply: impl FnMut(T, T) -> T,
    invert: impl FnOnce(T) -> T,
) -> Option<T> {
    let mut left = exponent.unsigned_abs();
    let mut square = base;
    let mut product: Option<T> = None;
    while left > 0 {
        if left & 1 == 1 {
            product = Some(match product {
                Some(part) => multiply(part, square),
                None => square,
            });
        }
        left >>= 1;
        if left > 0 {
            square = multiply(square, square);
        }
    }
    if exponent < 0 {
        product.map(invert)
    } else {
        product
    }
}

/// What a call by name does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Callable {
    One(Unary),
    Two(Binary),
    /// Two or more arguments, taken from the left.
    Many(Binary),
    If,
}

const FUNCTIONS: [(&str, Callable); 25] = [
    ("if", Callable::If),
    ("sin", Callable::One(Unary::Sin)),
    ("cos", Callable::One(Unary::Cos)),
    ("tan", Callable::One(Unary::Tan)),
    ("asin", Callable::One(Unary::Asin)),
    ("acos", Callable::One(Unary::Acos)),
    ("atan", Callable::One(Unary::Atan)),
    ("atan2", Callable::Two(Binary::Atan2)),
    ("sinh", Callable::One(Unary::Sinh)),
    ("cosh", Callable::One(Unary::Cosh)),
    ("tanh", Callable::One(Unary::Tanh)),
    ("exp", Callable::One(Unary::Exp)),
    ("ln", Callable::One(Unary::Ln)),
    ("log", Callable::One(Unary::Ln)),
    ("log10", Callable::One(Unary::Log10)),
    ("sqrt", Callable::One(Unary::Sqrt)),
    ("cbrt", Callable::One(Unary::Cbrt)),
    ("abs", Callable::One(Unary::Abs)),
    ("sign", Callable::One(Unary::Sign)),
    ("min", Callable::Many(Binary::Min)),
    ("max", Callable::Many(Binary::Max)),
    ("hypot", Callable::Two(Binary::Hypot)),
    ("floor", Callable::One(Unary::Floor)),
    ("ceil", Callable::One(Unary::Ceil)),
    ("step", Callable::One(Unary::Step)),
];

const VARIABLES: [&str; 3] = ["x", "y", "region"];
const CONSTANTS: [(&str, f64); 2] = [("pi", std::f64::consts::PI), ("e", std::f64::consts::E)];

/// The function of that name.
pub(crate) fn callable(name: &str) -> Option<Callable> {
    FUNCTIONS
        .iter()
        .find(|entry| entry.0 == name)
        .map(|entry| entry.1)
}

/// The mathematical constant of that name.
pub(crate) fn mathematical_constant(name: &str) -> Option<f64> {
    CONSTANTS
        .iter()
        .find(|entry| entry.0 == name)
        .map(|entry| entry.1)
}

/// The names of all functions.
pub(crate) fn functions<'n>() -> impl Iterator<Item = &'n str> {
    FUNCTIONS.iter().map(|entry| entry.0)
}

/// The names of the variables and mathematical constants.
pub(crate) fn values<'n>() -> impl Iterator<Item = &'n str> {
    VARIABLES
        .into_iter()
        .chain(CONSTANTS.iter().map(|entry| entry.0))
}

/// Whether the language itself uses the name.
pub(crate) fn is_reserved(name: &str) -> bool {
    functions().chain(values()).any(|known| known == name)
}
