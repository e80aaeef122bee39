(* Whether a () and b (), each evaluated in a process of its own. Trusted: the answer is true only if both are. *)
let both a b =
  match Unix.fork () with
  | exception Unix.Unix_error _ -> a () && b ()
  | 0 -> Unix._exit (if try a () with _ -> false then 0 else 1)
  | child ->
    let rec ended () = match Unix.waitpid [] child with
      | exception Unix.Unix_error (Unix.EINTR, _, _) -> ended ()
      | _, status -> status = Unix.WEXITED 0 in
    let right = b () in
    ended () && right
