//! Functions of a program's game as tests of its crate.

/// Makes a test of each of these functions of a [`GameProgram`](crate::GameProgram), under its name.
#[macro_export]
macro_rules! tests {
    ($game:ident: $($name:ident),+ $(,)?) => {
        $(
            #[test]
            fn $name() {
                $game.$name();
            }
        )+
    };
}
