//! A node on a TCP port, to try clients on: `--example mavlink_server -- 5760`.

use std::net::TcpListener;

use host_tests::mavlink_server::{Clock, serve};

fn main() -> std::io::Result<()> {
    let port = std::env::args()
        .nth(1)
        .and_then(|port| port.parse().ok())
        .unwrap_or(5_760);
    let listener = TcpListener::bind(("127.0.0.1", port))?;
    println!("a node at tcp:{}", listener.local_addr()?);
    serve(&listener, Clock::HostPlus(0))
}
