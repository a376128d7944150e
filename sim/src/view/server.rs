//! The server: the page, and a WebSocket for each page that is open.

use std::future::Future;
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{RawQuery, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde_json::json;
use tokio::net::TcpListener;
use tokio::sync::{broadcast, watch};
use tokio::time::{Instant, interval, timeout};

use super::access::{is_host, is_origin, is_same, token};
use super::inbox::{Inbox, Notice, Voices};
use super::page_files::{FILES, INDEX};
use super::painter::{Easel, paint};
use super::picture::{Picture, Seen};
use super::player::Player;
use super::protocol::{LONGEST_MESSAGE, Request};
use super::session::{Orders, Session};
use crate::{SimError, scene_file};

/// The most pages at a time.
const MOST_PAGES: usize = 8;

/// Pictures that are under way to a page or wait there.
const MOST_UNDRAWN: u32 = 2;

/// Notices that a slow page may be behind; older ones are left out.
const NOTICES: usize = 64;

/// How often a page is asked whether it is there.
const ASK: Duration = Duration::from_secs(3);

/// When a page that does not answer, or does not take what is sent, is given up.
const PATIENCE: Duration = Duration::from_secs(15);

/// What scripts, pictures and connections the page may have: its own.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// How a view is served.
#[derive(Clone, Debug)]
pub struct ViewOptions {
    /// A scene's name or file, or the directory of a run that is over.
    pub scene: String,
    /// Replaces values of the scene, `KEY=VALUE`.
    pub set: Vec<String>,
    /// What a second simulation of the scene has besides, `KEY=VALUE`: it is shown beside the first and led by the
    /// same hands. Nothing for none.
    pub beside: Vec<String>,
    /// The scan that the labels were made from, shown on cuts in place of them; that of the scene unless it is said.
    pub grey: Option<PathBuf>,
    /// Where it listens; loopback unless whoever starts it knows better.
    pub listen: IpAddr,
    /// The port; 0 for any that is free.
    pub port: u16,
    /// Whether the scene's own grabs and probes stay on their paths.
    pub play: bool,
    /// Whether steps go on while no page is open.
    pub keep_going: bool,
    /// Where recordings go; `runs/view` unless it is said.
    pub out: Option<PathBuf>,
    /// The program whose `run` makes recordings again.
    pub program: PathBuf,
}

/// Where a view is to be found.
#[derive(Clone, Debug)]
pub struct Listening {
    /// With the token in it.
    pub url: String,
}

/// What every connection shares.
struct Shared {
    token: String,
    is_open: bool,
    inbox: Arc<Inbox>,
    pictures: watch::Receiver<Arc<Picture>>,
    state: watch::Receiver<Arc<str>>,
    notices: broadcast::Sender<Notice>,
    pages: AtomicUsize,
    next_page: AtomicU64,
}

/// Serves a view until `end` is over; calls `ready` when the simulation is built and the server listens.
///
/// # Errors
/// Those of the scene, or of [`Run::open`](crate::playback::Run::open); [`SimError::Value`] for a run with
/// options of a scene; [`SimError::Io`] if the address can't be listened at.
pub fn serve(
    options: ViewOptions,
    end: impl Future<Output = ()>,
    ready: impl FnOnce(&Listening) -> Result<(), SimError>,
) -> Result<(), SimError> {
    let ViewOptions { scene, set, beside, grey, listen, port, play, keep_going, out, program } =
        options;
    let place = PathBuf::from(SocketAddr::new(listen, port).to_string());
    let io = |source| SimError::Io(place.clone(), source);
    let run = is_run(&scene).then(|| PathBuf::from(&scene));
    let of_scenes = [
        ("--set", !set.is_empty()),
        ("--beside", !beside.is_empty()),
        ("--grey", grey.is_some()),
        ("--play", play),
        ("--keep-going", keep_going),
        ("--out", out.is_some()),
    ];
    if run.is_some()
        && let Some((option, _)) = of_scenes.iter().find(|(_, is_given)| *is_given)
    {
        let want =
            "a scene: a run that is over goes by itself, can't be changed and is kept already";
        return Err(SimError::value(&format!("yawara view {option}"), "SCENE", scene, want));
    }
    let out = out.unwrap_or_else(|| Path::new("runs").join("view"));
    let orders = Orders { scene, set, beside, grey, play, keep_going, out, program };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(io)?;
    // Before the work, so that a port that is taken is known at once.
    let listener = runtime.block_on(TcpListener::bind((listen, port))).map_err(io)?;
    let address = listener.local_addr().map_err(io)?;
    let (inbox, easel) = (Arc::new(Inbox::default()), Arc::new(Easel::default()));
    let (pictures, seen) = watch::channel(Arc::new(Picture::default()));
    let (state, told) = watch::channel("".into());
    let notices = broadcast::channel(NOTICES).0;
    let voices = Arc::new(Voices { state, notices: notices.clone() });
    let painting = {
        let easel = Arc::clone(&easel);
        std::thread::spawn(move || paint(&easel, &pictures))
    };
    // A simulation stays in the thread that it was made in.
    let (built, is_built) = std::sync::mpsc::channel();
    let working = {
        let (inbox, closed) = (Arc::clone(&inbox), Arc::clone(&easel));
        std::thread::spawn(move || {
            let work: Result<Box<dyn FnOnce()>, SimError> = match &run {
                Some(folder) => Player::new(folder, inbox, easel, voices)
                    .map(|player| Box::new(|| player.run()) as Box<dyn FnOnce()>),
                None => Session::new(orders, inbox, easel, voices)
                    .map(|session| Box::new(|| session.run()) as Box<dyn FnOnce()>),
            };
            match work {
                Ok(work) => {
                    // Whoever asked waits for it.
                    let _ = built.send(Ok(()));
                    work();
                }
                Err(error) => {
                    closed.close();
                    let _ = built.send(Err(error));
                }
            }
        })
    };
    is_built.recv().unwrap_or(Ok(()))?;
    let shared = Arc::new(Shared {
        token: token()?,
        is_open: !listen.is_loopback(),
        inbox: Arc::clone(&inbox),
        pictures: seen,
        state: told,
        notices,
        pages: AtomicUsize::new(0),
        next_page: AtomicU64::new(1),
    });
    let host = match address.ip() {
        ip if ip.is_unspecified() => SocketAddr::new([127, 0, 0, 1].into(), address.port()),
        _ => address,
    };
    ready(&Listening { url: format!("http://{host}/?token={}", shared.token) })?;
    let mut router = Router::new().route("/", get(page)).route("/ws", get(socket));
    for (path, kind, text) in FILES {
        let file = move |State(shared): State<Arc<Shared>>, headers: HeaderMap| async move {
            match refused_host(&shared, &headers) {
                Some(refusal) => refusal,
                None => plain(kind, text),
            }
        };
        router = router.route(path, get(file));
    }
    let outcome = runtime.block_on(async {
        tokio::select! {
            served = axum::serve(listener, router.with_state(shared)) => served,
            () = end => Ok(()),
        }
    });
    inbox.end();
    let _ = (working.join(), painting.join());
    outcome.map_err(io)
}

/// Whether a name is that of a run directory and of no built-in scene.
fn is_run(scene: &str) -> bool {
    let is_built_in = scene_file::built_in().iter().any(|(name, _)| *name == scene);
    !is_built_in && Path::new(scene).is_dir()
}

fn plain(kind: &'static str, bytes: impl Into<axum::body::Body>) -> Response {
    let mut response = Response::new(bytes.into());
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_TYPE, kind),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refusal(status: StatusCode, why: &'static str) -> Response {
    let mut response = plain("text/plain; charset=utf-8", why);
    *response.status_mut() = status;
    response
}

fn host(headers: &HeaderMap) -> &str {
    headers.get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or_default()
}

fn refused_host(shared: &Shared, headers: &HeaderMap) -> Option<Response> {
    let is_ours = is_host(host(headers), shared.is_open);
    (!is_ours).then(|| refusal(StatusCode::MISDIRECTED_REQUEST, "no such host here\n"))
}

/// A refusal unless the request comes by this machine's name and knows the token.
fn refused(shared: &Shared, headers: &HeaderMap, query: Option<&str>) -> Option<Response> {
    let given = query.unwrap_or_default().split('&').find_map(|pair| pair.strip_prefix("token="));
    let knows = given.is_some_and(|given| is_same(given, &shared.token));
    refused_host(shared, headers).or_else(|| {
        let why = "this page needs the address with the token that `yawara view` has printed\n";
        (!knows).then(|| refusal(StatusCode::FORBIDDEN, why))
    })
}

async fn page(
    State(shared): State<Arc<Shared>>,
    headers: HeaderMap,
    RawQuery(query): RawQuery,
) -> Response {
    match refused(&shared, &headers, query.as_deref()) {
        Some(refusal) => refusal,
        None => plain("text/html; charset=utf-8", INDEX),
    }
}

async fn socket(
    State(shared): State<Arc<Shared>>,
    headers: HeaderMap,
    RawQuery(query): RawQuery,
    upgrade: WebSocketUpgrade,
) -> Response {
    if let Some(refusal) = refused(&shared, &headers, query.as_deref()) {
        return refusal;
    }
    let origin = headers.get(header::ORIGIN).and_then(|origin| origin.to_str().ok());
    // A program that is no browser has none.
    if origin.is_some_and(|origin| !is_origin(origin, host(&headers))) {
        return refusal(StatusCode::FORBIDDEN, "only from the page itself\n");
    }
    if shared.pages.fetch_add(1, Ordering::SeqCst) >= MOST_PAGES {
        shared.pages.fetch_sub(1, Ordering::SeqCst);
        return refusal(StatusCode::SERVICE_UNAVAILABLE, "too many pages are open\n");
    }
    let entry = Entry(shared);
    let bounded = upgrade.max_message_size(LONGEST_MESSAGE).max_frame_size(LONGEST_MESSAGE);
    bounded
        .on_upgrade(move |socket| async move { converse(socket, &entry.0).await })
        .into_response()
}

/// A page that counts while it is there.
struct Entry(Arc<Shared>);

impl Drop for Entry {
    fn drop(&mut self) {
        self.0.pages.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Speaks with a page until either ends.
async fn converse(mut socket: WebSocket, shared: &Shared) {
    let page = shared.next_page.fetch_add(1, Ordering::SeqCst);
    shared.inbox.enter();
    let _ = speak(&mut socket, shared, page).await;
    shared.inbox.leave(page);
}

/// Sends within the patience that a page is given.
async fn send(socket: &mut WebSocket, message: Message) -> Result<(), ()> {
    timeout(PATIENCE, socket.send(message)).await.map_err(|_| ())?.map_err(|_| ())
}

async fn speak(socket: &mut WebSocket, shared: &Shared, page: u64) -> Result<(), ()> {
    let mut notices = shared.notices.subscribe();
    let (mut pictures, mut state) = (shared.pictures.clone(), shared.state.clone());
    pictures.mark_changed();
    state.mark_changed();
    let welcome = json!({ "kind": "welcome", "page": page }).to_string();
    send(socket, Message::Text(welcome.into())).await?;
    let (mut seen, mut undrawn) = (Seen::default(), 0);
    let mut ask = interval(ASK);
    let mut heard = Instant::now();
    loop {
        tokio::select! {
            message = socket.recv() => {
                heard = Instant::now();
                let answer = match message {
                    Some(Ok(Message::Text(text))) => Request::read(&text),
                    Some(Ok(Message::Binary(_))) => Err("want text, not bytes".into()),
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => continue,
                    Some(Ok(Message::Close(_)) | Err(_)) | None => return Err(()),
                };
                let answer = answer.and_then(|request| match request {
                    Request::Drawn { count } => {
                        undrawn = undrawn.saturating_sub(count);
                        Ok(())
                    }
                    request => shared.inbox.send(page, request),
                });
                if let Err(why) = answer {
                    let notice = json!({ "kind": "notice", "level": "error", "text": why });
                    send(socket, Message::Text(notice.to_string().into())).await?;
                }
            }
            changed = state.changed() => {
                changed.map_err(|_| ())?;
                let text = state.borrow_and_update().to_string();
                send(socket, Message::Text(text.into())).await?;
            }
            changed = pictures.changed(), if undrawn < MOST_UNDRAWN => {
                changed.map_err(|_| ())?;
                // Of all that came meanwhile the last.
                let picture = Arc::clone(&pictures.borrow_and_update());
                if picture.number > 0 {
                    let bytes = picture.encode(seen);
                    seen = Seen { number: picture.number, generation: picture.generation };
                    send(socket, Message::Binary(bytes.into())).await?;
                    undrawn += 1;
                }
            }
            notice = notices.recv() => match notice {
                Ok((to, text)) if to.is_none_or(|to| to == page) => {
                    send(socket, Message::Text(text.to_string().into())).await?;
                }
                Ok(_) | Err(broadcast::error::RecvError::Lagged(_)) => {}
                Err(broadcast::error::RecvError::Closed) => return Err(()),
            },
            _ = ask.tick() => {
                if heard.elapsed() > PATIENCE {
                    return Err(());
                }
                send(socket, Message::Ping(Bytes::new())).await?;
            }
        }
    }
}
