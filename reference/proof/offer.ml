(* The crossing leaves that were deleted after gradation. They are not in any file, and the theorem holds for whatever is offered in their
   place, so nothing here is trusted: a wrong offer makes the checker reject.

   Gradation can split a crossing leaf of T0 only where a box finer than the surface is near. So leaves of T0 are split until none is
   too close to leaves that are finer by two levels or more. *)

type words = (int64, Bigarray.int64_elt, Bigarray.c_layout) Bigarray.Array1.t

(* A leaf without its side, key * 2^5 + level, fits into an integer. *)
type leaves = { count : int; get : int -> int }
let level v = v land 31
let key v = v lsr 5
let of_words (a : words) = { count = Bigarray.Array1.dim a; get = (fun i -> Int64.to_int (Int64.shift_right_logical a.{i} 2)) }
let of_array a = { count = Array.length a; get = Array.get a }
let to_words a : words =
  Bigarray.Array1.of_array Bigarray.int64 Bigarray.c_layout
    (Array.map (fun v -> Int64.logor (Int64.shift_left (Int64.of_int v) 2) 2L) a)

let corner v =
  let axis a =
    let x = ref 0 in
    for bit = 0 to 18 do if (key v) lsr (3 * bit + a) land 1 = 1 then x := !x lor (1 lsl bit) done;
    !x in
  [| axis 0; axis 1; axis 2 |]

(* The first leaf whose key is not before k. *)
let first s k =
  let rec search lo hi = if lo >= hi then lo else let i = (lo + hi) / 2 in if key (s.get i) < k then search (i + 1) hi else search lo i in
  search 0 s.count

(* Whether a leaf of a level of at least [wanted] is closer than [reach] to a leaf. *)
let finer s v wanted reach =
  let c = corner v and e = 1 lsl (19 - level v) in
  let rec any k l x y z =
    let f = 1 lsl (19 - l) in
    let near p q = q + f > p - reach && q < p + e + reach in
    near c.(0) x && near c.(1) y && near c.(2) z &&
    let i = first s k in
    i < s.count && key (s.get i) < k + (1 lsl (3 * (19 - l))) &&
    if s.get i = k lsl 5 lor l then l >= wanted
    else l < 19 && List.exists (fun j -> any (k + j lsl (3 * (18 - l))) (l + 1)
      (x + (j land 1) * f / 2) (y + (j lsr 1 land 1) * f / 2) (z + (j lsr 2) * f / 2)) [0; 1; 2; 3; 4; 5; 6; 7] in
  any 0 0 0 0 0

(* [layers]: n if layers are promised at all levels, and otherwise 0. *)
let refined layers (mesh : words list) (crossing : words list) : words list =
  let mesh = List.map of_words mesh in
  let rec refine a =
    let all = of_array a :: mesh in
    let split = Array.map (fun v ->
      let l = level v in
      l < 18 && let reach = max 1 (layers * (1 lsl (18 - l))) in List.exists (fun s -> finer s v (l + 2) reach) all) a in
    if not (Array.mem true split) then a else
      refine (Array.concat (Array.to_list (Array.mapi (fun i v ->
        if not split.(i) then [| v |] else
          Array.init 8 (fun j -> (key v + j lsl (3 * (18 - level v))) lsl 5 lor (level v + 1))) a))) in
  let all = Array.concat (List.map (fun w -> let s = of_words w in Array.init s.count s.get) crossing) in
  Array.sort compare all;
  [to_words (refine all)]
