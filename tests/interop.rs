//! A foreign master on our line: profirust 0.6, which nobody here wrote, brings our encoders into data exchange, and its
//! parser reads what our stations send.
//!
//! Where profirust and the model disagree, the standard decides:
//!
//! | point | profirust 0.6 | here | the standard |
//! |---|---|---|---|
//! | 8 octets behind FC | SD3, so its Chk_Cfg of telegram 81 is one | SD2 is sent, both are understood | both are allowed |
//! | DP-V0 services | SRD_low but for Data_Exchange, Global_Control by SDN_low | SRD_high, SDN_high | SRD_high, SDN_high; a slave takes either |
//! | idle time before a request | T_SYN = 33 t_bit always | T_ID1, or T_ID2 after what nobody answers | T_ID1 and T_ID2 |
//! | FCB after a refusal (RS) | not inverted: the next request, another one, looks like a repetition | inverted with each new request | inverted with each new request |
//! | FCB for a station that did not answer | goes on | FCV = 0, FCB = 1 | FCV = 0, FCB = 1 |
//! | Slave_Diag asked for between request and reply | the reply is taken for the diagnosis | waits its turn | the reply belongs to its request |
//! | time | whole microseconds: T_SYN at 12 Mbit/s is 2 us, a bit is nothing | 1/12 ns | 33 bits are 2.75 us |
//! | 45.45 kbit/s | 45 450 bit/s | 500/11 kbit/s | prints 45.45 |
//! | code 7 | "multicast SRD" | MSRD | MSRD; one name and one code in both |
//!
//! The two about FCB have a consequence: after a refused Set_Prm, profirust's Chk_Cfg is answered with RS, its next
//! Slave_Diag bears the same FCB, and a slave by the book repeats RS for ever. profirust learns of Prm_Fault only when
//! its peripheral is set up anew.
//!
//! Not asked of profirust, which cannot do it: isochronous mode, slave to slave, MS1, any mode but Operate.

mod data_exchange;
mod disagreement;
mod fault;
mod foreign;
mod parser;
