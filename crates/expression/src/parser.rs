//! A Pratt parser: from the text to the graph.

use crate::error::ParseError;
use crate::function::{Binary, Callable, Unary, callable, mathematical_constant};
use crate::graph::{Graph, Id, Node};
use crate::names;
use crate::scope::Scope;
use crate::token::{Kind, Lexer, Token};
use std::ops::Range;

/// Most operands one inside the other. `1 + 2*(` takes three: the sum, its right operand and the inside of the
/// parentheses. Each costs one or two kilobytes of the stack, of which a thread has two megabytes.
const DEEPEST: u32 = 400;

/// Longest source in bytes.
const LONGEST: usize = 1 << 24;

/// How tightly operators bind.
mod binding {
    pub(super) const OR: u8 = 1;
    pub(super) const AND: u8 = 2;
    pub(super) const COMPARISON: u8 = 3;
    pub(super) const SUM: u8 = 4;
    pub(super) const PRODUCT: u8 = 5;
    pub(super) const POWER: u8 = 6;
}

/// The graph of the formula and its root. `position` says whether `x`, `y` and `region` may be used.
pub(crate) fn parse(
    source: &str,
    scope: &Scope,
    position: bool,
) -> Result<(Graph, Id), ParseError> {
    if source.len() > LONGEST {
        let message = format!("an expression of {} bytes is too long", source.len());
        return Err(
            ParseError::new(0..source.len(), message).hint(format!("at most {LONGEST} bytes"))
        );
    }
    let mut lexer = Lexer::new(source);
    let token = lexer.next();
    if token.kind == Kind::End {
        return Err(ParseError::new(0..source.len(), "the expression is empty"));
    }
    let mut parser = Parser {
        source,
        lexer,
        token,
        end: 0,
        scope,
        position,
        graph: Graph::default(),
        depth: 0,
    };
    let root = parser.expression(0)?;
    match parser.token.kind {
        Kind::End => Ok((parser.graph, root.id)),
        Kind::Close => Err(ParseError::new(
            parser.token.span,
            "`)` without a `(` before it",
        )),
        _ => Err(parser.unexpected()),
    }
}

struct Parser<'s> {
    source: &'s str,
    lexer: Lexer<'s>,
    /// The token to come.
    token: Token,
    /// End of the token before it.
    end: usize,
    scope: &'s Scope,
    position: bool,
    graph: Graph,
    depth: u32,
}

/// A part of the formula and where it stands.
#[derive(Clone)]
struct Part {
    id: Id,
    span: Range<usize>,
}

impl<'s> Parser<'s> {
    /// Operands joined by operators that bind at least as tightly as `floor`.
    fn expression(&mut self, floor: u8) -> Result<Part, ParseError> {
        if self.depth == DEEPEST {
            return Err(self.too_deep());
        }
        self.depth += 1;
        let part = self.operators(floor);
        self.depth -= 1;
        part
    }

    fn operators(&mut self, floor: u8) -> Result<Part, ParseError> {
        let mut left = self.operand()?;
        // The operator and the right operand of the comparison that `left` is.
        let mut compared: Option<(Range<usize>, Range<usize>)> = None;
        loop {
            let Kind::Infix(op) = self.token.kind else {
                self.refuse_missing_operator(&left)?;
                return Ok(left);
            };
            let binds = binding_of(op);
            if binds < floor {
                return Ok(left);
            }
            let sign = self.token.span.clone();
            self.advance();
            // A power takes powers to its right, the others only what binds tighter.
            let right = self.expression(binds + u8::from(op != Binary::Pow))?;
            if op.is_comparison() {
                if let Some((first_sign, middle)) = compared {
                    return Err(self.chained(&left, first_sign, middle, sign, &right));
                }
                compared = Some((sign, right.span.clone()));
            } else {
                compared = None;
            }
            left = Part {
                id: self.graph.binary(op, left.id, right.id),
                span: left.span.start..right.span.end,
            };
        }
    }

    /// A number, a name, a call, a part in parentheses, or one of these with signs before it.
    fn operand(&mut self) -> Result<Part, ParseError> {
        let span = self.token.span.clone();
        match self.token.kind {
            Kind::Number(value) => {
                self.advance();
                let id = self.graph.number(value);
                Ok(Part { id, span })
            }
            Kind::Name => self.name(),
            Kind::Open => {
                self.advance();
                let inside = self.expression(0)?;
                self.close(&span)?;
                Ok(Part {
                    id: inside.id,
                    span: span.start..self.end,
                })
            }
            Kind::Infix(Binary::Add) => self.signed(None),
            Kind::Infix(Binary::Sub) => self.signed(Some(Unary::Neg)),
            Kind::Prefix(op) => self.signed(Some(op)),
            _ => Err(self.unexpected()),
        }
    }

    fn signed(&mut self, op: Option<Unary>) -> Result<Part, ParseError> {
        let span = self.token.span.clone();
        self.advance();
        let operand = self.expression(binding::POWER)?;
        Ok(Part {
            id: op.map_or(operand.id, |op| self.graph.unary(op, operand.id)),
            span: span.start..operand.span.end,
        })
    }

    fn name(&mut self) -> Result<Part, ParseError> {
        let span = self.token.span.clone();
        let name = &self.source[span.clone()];
        self.advance();
        let called = self.token.kind == Kind::Open;
        if let Some(function) = callable(name) {
            if called {
                return self.call(name, function, span);
            }
            let message = format!("`{name}` is a function and needs its arguments");
            return Err(ParseError::new(span, message)
                .hint(format!("write `{}`", signature(name, function))));
        }
        let variable = match name {
            "x" => Some(Node::X),
            "y" => Some(Node::Y),
            "region" => Some(Node::Region),
            _ => None,
        };
        let id = if let Some(node) = variable {
            if !self.position {
                return Err(
                    ParseError::new(span, format!("`{name}` cannot be used here")).hint(
                        "this is one number for the whole scene: use numbers and parameters only",
                    ),
                );
            }
            self.graph.add_node(node)
        } else if let Some(value) = mathematical_constant(name).or_else(|| self.scope.get(name)) {
            self.graph.number(value)
        } else {
            let what = if called { "function" } else { "name" };
            return Err(ParseError::new(span, format!("unknown {what} `{name}`"))
                .hint(names::hint(name, called, self.scope)));
        };
        Ok(Part { id, span })
    }

    /// The arguments of a function, the parser being at its `(`.
    fn call(
        &mut self,
        name: &str,
        function: Callable,
        span: Range<usize>,
    ) -> Result<Part, ParseError> {
        let open = self.token.span.clone();
        self.advance();
        let mut arguments: Vec<Part> = Vec::new();
        if self.token.kind != Kind::Close {
            loop {
                arguments.push(self.expression(0)?);
                if self.token.kind != Kind::Comma {
                    break;
                }
                self.advance();
            }
        }
        self.close(&open)?;
        let span = span.start..self.end;
        let id = match (function, arguments.as_slice()) {
            (Callable::One(op), [a]) => self.graph.unary(op, a.id),
            (Callable::Two(op), [a, b]) => self.graph.binary(op, a.id, b.id),
            (Callable::Many(op), [first, rest @ ..]) if !rest.is_empty() => {
                rest.iter().fold(first.id, |left, right| {
                    self.graph.binary(op, left, right.id)
                })
            }
            (Callable::If, [c, a, b]) => self.graph.choose(c.id, a.id, b.id),
            _ => return Err(self.wrong_count(name, function, &arguments, span)),
        };
        Ok(Part { id, span })
    }

    fn wrong_count(
        &self,
        name: &str,
        function: Callable,
        arguments: &[Part],
        span: Range<usize>,
    ) -> ParseError {
        let wanted = match function {
            Callable::One(_) => "1 argument",
            Callable::Two(_) => "2 arguments",
            Callable::Many(_) => "at least 2 arguments",
            Callable::If => "3 arguments",
        };
        let error = ParseError::new(
            span,
            format!("`{name}` takes {wanted}, not {}", arguments.len()),
        );
        let decimal = arguments.windows(2).find_map(|pair| {
            let (whole, part) = (
                &self.source[pair[0].span.clone()],
                &self.source[pair[1].span.clone()],
            );
            (pair[0].span.end + 1 == pair[1].span.start).then_some(())?;
            decimal_comma(whole, part)
        });
        error.hint(decimal.unwrap_or_else(|| format!("write `{}`", signature(name, function))))
    }

    /// Steps over the `)` that belongs to the `(` at `open`.
    fn close(&mut self, open: &Range<usize>) -> Result<(), ParseError> {
        match self.token.kind {
            Kind::Close => {
                self.advance();
                Ok(())
            }
            Kind::End => Err(ParseError::new(open.clone(), "`(` without a `)` after it")),
            _ => Err(self.unexpected()),
        }
    }

    #[cold]
    fn too_deep(&self) -> ParseError {
        ParseError::new(
            self.token.span.clone(),
            "the expression is nested too deeply",
        )
        .hint(format!("at most {DEEPEST} operands one inside the other"))
    }

    fn advance(&mut self) {
        self.end = self.token.span.end;
        self.token = self.lexer.next();
    }

    /// Complains of the token to come.
    fn unexpected(&self) -> ParseError {
        let span = self.token.span.clone();
        let text = &self.source[span.clone()];
        match &self.token.kind {
            Kind::Bad(error) => (**error).clone(),
            Kind::End => ParseError::new(span, "the expression ends too early"),
            Kind::Comma => {
                let error = ParseError::new(span.clone(), "unexpected `,`");
                let before = &self.source[..span.start];
                let whole = before.trim_end_matches(|c: char| c.is_ascii_digit()).len();
                let after = &self.source[span.end..];
                let part = after
                    .find(|c: char| !c.is_ascii_digit())
                    .unwrap_or(after.len());
                match decimal_comma(&before[whole..], &after[..part]) {
                    Some(hint) => error.hint(hint),
                    None => error,
                }
            }
            Kind::Infix(_) => ParseError::new(span, format!("unexpected `{text}`"))
                .hint("an operand is missing before it"),
            _ => ParseError::new(span, format!("unexpected `{text}`")),
        }
    }

    /// After an operand only an operator, `,`, `)` or the end may come.
    fn refuse_missing_operator(&self, left: &Part) -> Result<(), ParseError> {
        if !matches!(
            self.token.kind,
            Kind::Number(_) | Kind::Name | Kind::Open | Kind::Prefix(_) | Kind::Bad(_)
        ) {
            return Ok(());
        }
        if matches!(self.token.kind, Kind::Bad(_)) {
            return Err(self.unexpected());
        }
        let next = &self.source[self.token.span.clone()];
        let before = &self.source[left.span.clone()];
        let error = ParseError::new(
            self.token.span.clone(),
            format!("an operator is missing before `{next}`"),
        );
        let number = before.ends_with(|c: char| c.is_ascii_digit() || c == '.');
        Err(match self.token.kind {
            Kind::Name if number && next.starts_with('_') => {
                error.hint("write numbers without `_`")
            }
            Kind::Number(_) if number => error,
            Kind::Prefix(_) => {
                error.hint("`!` comes before what it negates; write `!=` for unequal")
            }
            Kind::Name if let Some(hint) = names::foreign(next) => error.hint(hint),
            // `2x`, `2(x + 1)`, `x y`: only as much of the left side as stands next to it.
            Kind::Open => error.hint(format!("write `{}*(...)`", last_word(before))),
            _ => error.hint(format!("write `{}*{next}`", last_word(before))),
        })
    }

    fn chained(
        &self,
        left: &Part,
        first_sign: Range<usize>,
        middle: Range<usize>,
        sign: Range<usize>,
        right: &Part,
    ) -> ParseError {
        let text = |span: Range<usize>| &self.source[span];
        let first = text(left.span.start..middle.end);
        let (middle, last) = (text(middle), text(right.span.clone()));
        let error = ParseError::new(
            left.span.start..right.span.end,
            "comparisons cannot be chained",
        );
        if first.len() + middle.len() + last.len() > 80 {
            let (one, two) = (text(first_sign), text(sign));
            return error.hint(format!("write `a {one} b && b {two} c`"));
        }
        error.hint(format!("write `{first} && {middle} {} {last}`", text(sign)))
    }
}

fn binding_of(op: Binary) -> u8 {
    match op {
        Binary::Or => binding::OR,
        Binary::And => binding::AND,
        Binary::Add | Binary::Sub => binding::SUM,
        Binary::Mul | Binary::Div => binding::PRODUCT,
        Binary::Lt | Binary::Le | Binary::Gt | Binary::Ge | Binary::Eq | Binary::Ne => {
            binding::COMPARISON
        }
        Binary::Pow | Binary::Min | Binary::Max | Binary::Hypot | Binary::Atan2 => binding::POWER,
    }
}

/// How a call is written.
fn signature(name: &str, function: Callable) -> String {
    match function {
        Callable::One(_) => format!("{name}(a)"),
        Callable::Two(Binary::Atan2) => "atan2(y, x)".to_owned(),
        Callable::Two(_) => format!("{name}(a, b)"),
        Callable::Many(_) => format!("{name}(a, b, ...)"),
        Callable::If => "if(condition, then, else)".to_owned(),
    }
}

/// The hint for `0,5`, given what stands on both sides of the comma.
fn decimal_comma(whole: &str, part: &str) -> Option<String> {
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (digits(whole) && digits(part))
        .then(|| format!("decimal numbers are written with a point: `{whole}.{part}`"))
}

/// The number, name or closing parenthesis at the end of a text.
fn last_word(text: &str) -> &str {
    if text.ends_with(')') {
        return "(...)";
    }
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    &text[text.trim_end_matches(word).len()..]
}
