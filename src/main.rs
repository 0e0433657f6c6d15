fn main() -> std::process::ExitCode {
    marsyard::cli::main()
}
