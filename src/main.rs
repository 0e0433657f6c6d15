//! The program: the library's command line, with the functions of numbers of the C library replaced by the pinned ones.

mod c_symbols;

fn main() -> std::process::ExitCode {
    marsyard::cli::main()
}
