//! What may stand between robot and edge: datagrams that get lost, or come changed. Both sides have sockets of their own.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use admittance_host::clock::monotonic_ns;
use egm_messages::{EgmRobot, EgmSensor, Message};

/// What becomes of the robot's messages.
#[derive(Clone, Copy)]
pub(crate) enum ToEdge {
    Pass,
    Lose,
    /// They come with something else in them.
    Change(fn(&mut EgmRobot)),
    /// They come as something else.
    Mangle(fn(&mut Vec<u8>)),
}

/// What becomes of the edge's.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum ToRobot {
    Pass,
    Lose,
}

/// Joint speeds in degrees/s that the edge sent, and when (CLOCK_MONOTONIC, ns).
pub(crate) type Sent = (u64, Vec<f64>);

struct Shared {
    end: AtomicBool,
    way: Mutex<(ToEdge, ToRobot)>,
    robot: Mutex<Option<SocketAddr>>,
    sent: Mutex<Vec<Sent>>,
}

/// A network between one robot and one edge.
pub(crate) struct Network {
    /// Where the robot finds the edge.
    pub(crate) address: SocketAddr,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl Network {
    pub(crate) fn before(edge: SocketAddr) -> Self {
        let socket = || {
            let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port is free");
            socket.set_read_timeout(Some(Duration::from_millis(20))).expect("a socket");
            Arc::new(socket)
        };
        let (to_robot, to_edge) = (socket(), socket());
        let address = to_robot.local_addr().expect("it is bound");
        let shared = Arc::new(Shared {
            end: AtomicBool::new(false),
            way: Mutex::new((ToEdge::Pass, ToRobot::Pass)),
            robot: Mutex::new(None),
            sent: Mutex::new(Vec::new()),
        });
        let there = {
            let (shared, from, to) = (Arc::clone(&shared), Arc::clone(&to_robot), Arc::clone(&to_edge));
            std::thread::spawn(move || {
                shared.carry(&from, |datagram, robot| shared.to_edge(datagram, robot, &to, edge))
            })
        };
        let back = {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || shared.carry(&to_edge, |datagram, _| shared.to_robot(&datagram, &to_robot)))
        };
        Self { address, shared, threads: vec![there, back] }
    }

    /// From now on it does this.
    pub(crate) fn become_like(&self, to_edge: ToEdge, to_robot: ToRobot) {
        *lock(&self.shared.way) = (to_edge, to_robot);
    }

    /// What the edge has sent, also what was lost on the way.
    pub(crate) fn sent(&self) -> Vec<Sent> {
        lock(&self.shared.sent).clone()
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        self.shared.end.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // One that failed has said so.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn carry(&self, from: &UdpSocket, mut each: impl FnMut(Vec<u8>, SocketAddr)) {
        let mut buffer = [0; 8192];
        while !self.end.load(Ordering::Relaxed) {
            if let Ok((length, sender)) = from.recv_from(&mut buffer) {
                each(buffer[..length].to_vec(), sender);
            }
        }
    }

    fn to_edge(&self, mut datagram: Vec<u8>, robot: SocketAddr, to: &UdpSocket, edge: SocketAddr) {
        *lock(&self.robot) = Some(robot);
        match lock(&self.way).0 {
            ToEdge::Pass => {}
            ToEdge::Lose => return,
            ToEdge::Change(change) => {
                let mut message = EgmRobot::decode(&datagram[..]).expect("the emulated robot sends messages");
                change(&mut message);
                datagram = message.encode_to_vec();
            }
            ToEdge::Mangle(mangle) => mangle(&mut datagram),
        }
        // An edge that has ended hears nothing.
        let _ = to.send_to(&datagram, edge);
    }

    fn to_robot(&self, datagram: &[u8], to: &UdpSocket) {
        let message = EgmSensor::decode(datagram).expect("the edge sends messages");
        let speeds = message.speed_ref.and_then(|speeds| speeds.joints).expect("it sends joint speeds").joints;
        lock(&self.sent).push((monotonic_ns(), speeds));
        if let Some(robot) = *lock(&self.robot)
            && lock(&self.way).1 == ToRobot::Pass
        {
            let _ = to.send_to(datagram, robot);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
