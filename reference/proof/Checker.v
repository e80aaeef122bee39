(** The program: files become trees, and every promise is a walk over trees.

    Arithmetic is that of OCaml's integers of 63 bits: [add], [sub] and [mul] wrap, and the proofs show where they are used that they
    do not. What is only compared, halved or copied needs no such argument. *)
From Coq Require Import ZArith List Bool.
Import ListNotations.
From Proof Require Import Statement.
Open Scope Z_scope.

Definition wrap (a : Z) : Z := (a + 4611686018427387904) mod 9223372036854775808 - 4611686018427387904.
Definition add (a b : Z) : Z := wrap (a + b).
Definition sub (a b : Z) : Z := wrap (a - b).
Definition mul (a b : Z) : Z := wrap (a * b).

(** * Trees *)

(** What fills a cube: nothing, or a leaf. [Reached] is a leaf of the side that is flooded, see [flood]. *)
Inductive kind := Empty | Outer | Inner | Cross | Reached.

(** Children are in Morton order. A node keeps the greatest and the least edge of its leaves, and whether a leaf of the kind that
    is looked for is among them. *)
Inductive tree :=
  | Cube (k : kind)
  | Node (most least : Z) (has : bool) (a b c d e f g h : tree).

Definition same (k k' : kind) : bool :=
  match k, k' with
  | Empty, Empty | Outer, Outer | Inner, Inner | Cross, Cross | Reached, Reached => true
  | _, _ => false
  end.
Definition none : Z := 4194304.
Definition most (t : tree) (e : Z) : Z := match t with Cube Empty => 0 | Cube _ => e | Node m _ _ _ _ _ _ _ _ _ _ => m end.
Definition least (t : tree) (e : Z) : Z := match t with Cube Empty => none | Cube _ => e | Node _ m _ _ _ _ _ _ _ _ _ => m end.
Definition has (k : kind) (t : tree) : bool := match t with Cube k' => same k k' | Node _ _ b _ _ _ _ _ _ _ _ => b end.

(** The child at the far end (true) or the near end of each axis; a cube is its own child. *)
Definition kid (i j k : bool) (t : tree) : tree :=
  match t with
  | Cube _ => t
  | Node _ _ _ a b c d e f g h => if k then if j then if i then h else g else if i then f else e
                                  else if j then if i then d else c else if i then b else a
  end.

Definition max8 a b c d e f g h := Z.max (Z.max (Z.max a b) (Z.max c d)) (Z.max (Z.max e f) (Z.max g h)).
Definition min8 a b c d e f g h := Z.min (Z.min (Z.min a b) (Z.min c d)) (Z.min (Z.min e f) (Z.min g h)).
Definition all8 (a b c d e f g h : bool) : bool := a && b && c && d && e && f && g && h.

(** The parent of eight trees with edge z. *)
Definition join (k : kind) (z : Z) (a b c d e f g h : tree) : tree :=
  Node (max8 (most a z) (most b z) (most c z) (most d z) (most e z) (most f z) (most g z) (most h z))
       (min8 (least a z) (least b z) (least c z) (least d z) (least e z) (least f z) (least g z) (least h z))
       (has k a || has k b || has k c || has k d || has k e || has k f || has k g || has k h) a b c d e f g h.

(** Most parents have eight equal leaves. Those of one edge share their memory. *)
Definition brood (z : Z) (b : bool) (k : kind) : tree := Node z z b (Cube k) (Cube k) (Cube k) (Cube k) (Cube k) (Cube k) (Cube k) (Cube k).
Inductive broods := Broods (z : Z) (outer outer' inner inner' cross cross' : tree).
Definition all_broods : list broods :=
  map (fun z => Broods z (brood z false Outer) (brood z true Outer) (brood z false Inner) (brood z true Inner) (brood z false Cross) (brood z true Cross))
    [1; 2; 4; 8; 16; 32; 64; 128; 256; 512; 1024; 2048; 4096; 8192; 16384; 32768; 65536; 131072; 262144].
Definition same_brood (t u : tree) : bool :=
  match t, u with
  | Node p q r (Cube a) (Cube b) (Cube c) (Cube d) (Cube e) (Cube f) (Cube g) (Cube h),
    Node p' q' r' (Cube a') (Cube b') (Cube c') (Cube d') (Cube e') (Cube f') (Cube g') (Cube h') =>
    (p =? p') && (q =? q') && (if r then r' else negb r') &&
    same a a' && same b b' && same c c' && same d d' && same e e' && same f f' && same g g' && same h h'
  | _, _ => false
  end.
Fixpoint twig_of (s : list broods) (z : Z) (b : bool) (k : kind) : tree :=
  match s with
  | [] => brood z b k
  | Broods z' o o' i i' x x' :: s =>
    if z' =? z then
      match k with Outer => if b then o' else o | Inner => if b then i' else i | Cross => if b then x' else x | _ => brood z b k end
    else twig_of s z b k
  end.
Definition twig (z : Z) (b : bool) (k : kind) : tree := twig_of all_broods z b k.
Fixpoint share_with (s : list broods) (t : tree) (m : Z) (r : bool) (k : kind) : tree :=
  match s with
  | [] => t
  | Broods z o o' i i' x x' :: s =>
    if z =? m then
      let u := match k with Outer => if r then o' else o | Inner => if r then i' else i | Cross => if r then x' else x | _ => t end in
      if same_brood u t then u else t
    else share_with s t m r k
  end.
Definition share (t : tree) : tree := match t with Node m _ r (Cube k) (Cube _) _ _ _ _ _ _ => share_with all_broods t m r k | _ => t end.

(** * Reading *)

Inductive parsed := Bad | Good (t : tree) (next : Z).
Section Read.
Variable looked_for : kind.

(** The octant with key k, level l, edge z, volume v; i is the next leaf. *)
Fixpoint parse (p : part) (fuel : nat) (l z v k i : Z) : parsed :=
  if i <? count p then
    let q := key p i in
    if add k v <=? q then Good (Cube Empty) i
    else if (q =? k) && (Z.shiftr (code p i) 2 =? l) then
      let s := Z.land (code p i) 3 in
      if s =? 0 then Good (Cube Outer) (add i 1) else if s =? 1 then Good (Cube Inner) (add i 1)
      else if s =? 2 then Good (Cube Cross) (add i 1) else Bad
    else match fuel with
    | O => Bad
    | S n =>
      let l := add l 1 in let z := Z.shiftr z 1 in let v := Z.shiftr v 3 in
      match parse p n l z v k i with Bad => Bad | Good a i =>
      let k := add k v in match parse p n l z v k i with Bad => Bad | Good b i =>
      let k := add k v in match parse p n l z v k i with Bad => Bad | Good c i =>
      let k := add k v in match parse p n l z v k i with Bad => Bad | Good d i =>
      let k := add k v in match parse p n l z v k i with Bad => Bad | Good e i =>
      let k := add k v in match parse p n l z v k i with Bad => Bad | Good f i =>
      let k := add k v in match parse p n l z v k i with Bad => Bad | Good g i =>
      let k := add k v in match parse p n l z v k i with Bad => Bad | Good h i =>
      Good (share (join looked_for z a b c d e f g h)) i
      end end end end end end end end
    end
  else Good (Cube Empty) i.

(** Both trees in one, if no leaves of theirs overlap; z is the edge. *)
Fixpoint merge (t u : tree) (z : Z) : option tree :=
  match t, u with
  | Cube Empty, _ => Some u
  | _, Cube Empty => Some t
  | Node _ _ _ a b c d e f g h, Node _ _ _ a' b' c' d' e' f' g' h' =>
    let z := Z.shiftr z 1 in
    match merge a a' z with None => None | Some a => match merge b b' z with None => None | Some b =>
    match merge c c' z with None => None | Some c => match merge d d' z with None => None | Some d =>
    match merge e e' z with None => None | Some e => match merge f f' z with None => None | Some f =>
    match merge g g' z with None => None | Some g => match merge h h' z with None => None | Some h =>
    Some (join looked_for z a b c d e f g h)
    end end end end end end end end
  | _, _ => None
  end.

Definition read (p : part) : option tree :=
  if (0 <=? count p) && (count p <=? 144115188075855872) then
    match parse p 19 0 524288 144115188075855872 0 0 with
    | Good t i => if i =? count p then Some t else None
    | Bad => None
    end
  else None.
Fixpoint build (parts : list part) : option tree :=
  match parts with
  | [] => Some (Cube Empty)
  | p :: rest => match read p with None => None | Some t =>
                 match build rest with None => None | Some u => merge t u 524288 end end
  end.
End Read.

(** * Counts *)

(** Leaves of edge w in a tree of edge z. Cubes cost no call. *)
Definition count_cube (w z : Z) (k : kind) : Z := if same Empty k then 0 else if z =? w then 1 else 0.
Definition count_child (count : tree -> Z) (w z : Z) (t : tree) : Z := match t with Cube k => count_cube w z k | _ => count t end.
Fixpoint count_edge (w z : Z) (t : tree) : Z :=
  match t with
  | Cube k => count_cube w z k
  | Node m l _ a b c d e f g h =>
    if (m <? w) || (w <? l) then 0 else
    let z := Z.shiftr z 1 in let count := count_edge w z in
    add (count_child count w z a) (add (count_child count w z b) (add (count_child count w z c) (add (count_child count w z d)
   (add (count_child count w z e) (add (count_child count w z f) (add (count_child count w z g) (count_child count w z h)))))))
  end.
(** Leaves of each kind, added to those that were counted before. *)
Inductive tally := Tally (outer inner cross : Z).
Fixpoint count_kinds (t : tree) (s : tally) : tally :=
  match t with
  | Cube k =>
    match s with Tally o i x =>
      match k with Outer => Tally (add o 1) i x | Inner => Tally o (add i 1) x | Cross => Tally o i (add x 1) | _ => s end
    end
  | Node _ _ _ a b c d e f g h =>
    count_kinds h (count_kinds g (count_kinds f (count_kinds e (count_kinds d (count_kinds c (count_kinds b (count_kinds a s)))))))
  end.
Fixpoint all_equal (a b : list Z) : bool :=
  match a, b with [], [] => true | x :: a, y :: b => (x =? y) && all_equal a b | _, _ => false end.
Definition edges : list Z := [524288; 262144; 131072; 65536; 32768; 16384; 8192; 4096; 2048; 1024; 512; 256; 128; 64; 32; 16; 8; 4; 2; 1].
Definition sum3 (s : list Z) : Z := match s with [a; b; c] => add a (add b c) | _ => -1 end.
Definition check_counts (f : manifest) (parts : list part) (t : tree) : bool :=
  let sides := match count_kinds t (Tally 0 0 0) with Tally o i x => [o; i; x] end in
  all_equal (by_part f) (map count parts) && all_equal (by_level f) (map (fun w => count_edge w 524288 t) edges) &&
  all_equal (by_side f) sides && (total f =? sum3 sides).

(** * Pairs of leaves *)

(** The distance along one axis of intervals of lengths p and q, of which the second is displaced by d; negative if they overlap. *)
Definition apart (p q d : Z) : Z := Z.max (sub d p) (sub (sub 0 d) q).

Section Walk.
(** Whether no pair of leaves in two cubes with edges p and q can violate the rule: wherever they are, or at distance d. *)
Variable skip : tree -> Z -> tree -> Z -> bool.
Variable stop : tree -> Z -> tree -> Z -> Z -> bool.
(** Most pairs are skipped, and cost no call. *)
Local Notation "'pass' f n t u p q x y z" := (skip t p u q || f n t u p q x y z)
  (at level 10, f at level 9, n at level 9, t at level 9, u at level 9, p at level 9, q at level 9, x at level 9, y at level 9, z at level 9).

(** No leaf of t (edge p) and leaf of u (edge q), displaced by (x, y, z), violate the rule. The larger cube is split; of two equal ones the
    second, because its leaves are finer. *)
Fixpoint walk (fuel : nat) (t u : tree) (p q x y z : Z) : bool :=
  if stop t p u q (Z.max (apart p q x) (Z.max (apart p q y) (apart p q z))) then true else
  match fuel with
  | O => false
  | S n =>
    match t, u with
    | Node _ _ _ a b c d e f g h, Cube _ =>
      let p := Z.shiftr p 1 in
      pass walk n a u p q x y z && pass walk n b u p q (sub x p) y z && pass walk n c u p q x (sub y p) z &&
      pass walk n d u p q (sub x p) (sub y p) z &&
      pass walk n e u p q x y (sub z p) && pass walk n f u p q (sub x p) y (sub z p) && pass walk n g u p q x (sub y p) (sub z p) &&
      pass walk n h u p q (sub x p) (sub y p) (sub z p)
    | Node _ _ _ a b c d e f g h, Node _ _ _ a' b' c' d' e' f' g' h' =>
      if q <? p then
        let p := Z.shiftr p 1 in
        pass walk n a u p q x y z && pass walk n b u p q (sub x p) y z && pass walk n c u p q x (sub y p) z &&
        pass walk n d u p q (sub x p) (sub y p) z &&
        pass walk n e u p q x y (sub z p) && pass walk n f u p q (sub x p) y (sub z p) && pass walk n g u p q x (sub y p) (sub z p) &&
        pass walk n h u p q (sub x p) (sub y p) (sub z p)
      else
        let q := Z.shiftr q 1 in
        pass walk n t a' p q x y z && pass walk n t b' p q (add x q) y z && pass walk n t c' p q x (add y q) z &&
        pass walk n t d' p q (add x q) (add y q) z &&
        pass walk n t e' p q x y (add z q) && pass walk n t f' p q (add x q) y (add z q) && pass walk n t g' p q x (add y q) (add z q) &&
        pass walk n t h' p q (add x q) (add y q) (add z q)
    | _, Node _ _ _ a' b' c' d' e' f' g' h' =>
      let q := Z.shiftr q 1 in
      pass walk n t a' p q x y z && pass walk n t b' p q (add x q) y z && pass walk n t c' p q x (add y q) z &&
      pass walk n t d' p q (add x q) (add y q) z &&
      pass walk n t e' p q x y (add z q) && pass walk n t f' p q (add x q) y (add z q) && pass walk n t g' p q x (add y q) (add z q) &&
      pass walk n t h' p q (add x q) (add y q) (add z q)
    | _, _ => false
    end
  end.
End Walk.

(** Balance and layers are one rule: a leaf of edge e keeps away from leaves of edge at most e / 4, by n e / 2 where layers are
    asked for ([wide] <= e), and else by more than nothing. *)
Definition graded_stop (n wide : Z) (t : tree) (p : Z) (u : tree) (q d : Z) : bool :=
  let w := most t p in
  if w <? mul 4 (least u q) then true else if wide <=? w then mul n w <=? mul 2 d else 0 <? d.

(** * Base tree *)

Fixpoint every (f : kind -> bool) (t : tree) : bool :=
  match t with
  | Cube k => f k
  | Node _ _ _ a b c d e f' g h =>
    every f a && every f b && every f c && every f d && every f e && every f f' && every f g && every f h
  end.

(** Crossing leaves have at most the edge s. *)
Fixpoint fine_tree (s : Z) (t : tree) (z : Z) : bool :=
  if most t z <=? s then true else
  match t with
  | Cube k => negb (same Cross k)
  | Node _ _ _ a b c d e f g h =>
    let z := Z.shiftr z 1 in
    fine_tree s a z && fine_tree s b z && fine_tree s c z && fine_tree s d z &&
    fine_tree s e z && fine_tree s f z && fine_tree s g z && fine_tree s h z
  end.

Inductive axis := X | Y | Z_.
Definition kid_on (a : axis) (s i j : bool) (t : tree) : tree :=
  match a with X => kid s i j t | Y => kid i s j t | Z_ => kid i j s t end.

(** Components meet only crossing leaves. [Empty] stands for what is outside of the root: leaves of kind k do not reach it. *)
Definition may_share (k a b : kind) : bool :=
  match a, b with Cross, _ | _, Cross => true | Empty, _ => negb (same k b) | _, Empty => negb (same k a) | _, _ => same a b end.

(** Leaves that share part of a face of t and u, where u follows t along the axis. *)
Fixpoint face (k : kind) (fuel : nat) (a : axis) (t u : tree) : bool :=
  match t, u with
  | Cube k1, Cube k2 => may_share k k1 k2
  | _, _ =>
    match fuel with
    | O => false
    | S n =>
      face k n a (kid_on a true false false t) (kid_on a false false false u) && face k n a (kid_on a true true false t) (kid_on a false true false u) &&
      face k n a (kid_on a true false true t) (kid_on a false false true u) && face k n a (kid_on a true true true t) (kid_on a false true true u)
    end
  end.
Fixpoint faces (k : kind) (fuel : nat) (t : tree) : bool :=
  match t with
  | Cube _ => true
  | Node _ _ _ a b c d e f g h =>
    match fuel with
    | O => false
    | S n =>
      face k n X a b && face k n X c d && face k n X e f && face k n X g h &&
      face k n Y a c && face k n Y b d && face k n Y e g && face k n Y f h &&
      face k n Z_ a e && face k n Z_ b f && face k n Z_ c g && face k n Z_ d h &&
      faces k n a && faces k n b && faces k n c && faces k n d && faces k n e && faces k n f && faces k n g && faces k n h
    end
  end.
Definition rim (k : kind) (t : tree) : bool :=
  face k 20 X (Cube Empty) t && face k 20 X t (Cube Empty) && face k 20 Y (Cube Empty) t && face k 20 Y t (Cube Empty) &&
  face k 20 Z_ (Cube Empty) t && face k 20 Z_ t (Cube Empty).

(** * Flood: leaves of kind k become [Reached] from neighbours that are *)

(** Whether a face of a tree, at the near (false) or far end of an axis, has a [Reached] leaf. *)
Fixpoint wet (fuel : nat) (a : axis) (s : bool) (t : tree) : bool :=
  match t with
  | Cube k => same Reached k
  | Node _ _ _ _ _ _ _ _ _ _ _ =>
    match fuel with
    | O => false
    | S n => wet n a s (kid_on a s false false t) || wet n a s (kid_on a s true false t) ||
             wet n a s (kid_on a s false true t) || wet n a s (kid_on a s true true t)
    end
  end.

Section Flood.
Variable k : kind.
(** The order of a sweep: along each axis from the near end to the far one (false), or back. *)
Variables i j l : bool.

Definition T (x y z : bool) (t : tree) : tree := kid (xorb i x) (xorb j y) (xorb l z) t.

(** One sweep through t, whose neighbours before it and after it along x, y, z, in the order of the sweep, are a, b, c and d, e, f.
    [has] of a node is whether leaves of kind k are left in it. *)
Fixpoint flood (fuel : nat) (t a b c d e f : tree) : tree :=
  match t with
  | Cube k' =>
    if same k k' then
      if wet 20 X (negb i) a || wet 20 Y (negb j) b || wet 20 Z_ (negb l) c || wet 20 X i d || wet 20 Y j e || wet 20 Z_ l f
      then Cube Reached else t
    else t
  | Node p q some _ _ _ _ _ _ _ _ =>
    if some then
      match fuel with
      | O => t
      | S n =>
        let r0 := flood n (T false false false t) (T true false false a) (T false true false b) (T false false true c)
                  (T true false false t) (T false true false t) (T false false true t) in
        let r1 := flood n (T true false false t) r0 (T true true false b) (T true false true c)
                  (T false false false d) (T true true false t) (T true false true t) in
        let r2 := flood n (T false true false t) (T true true false a) r0 (T false true true c)
                  (T true true false t) (T false false false e) (T false true true t) in
        let r3 := flood n (T true true false t) r2 r1 (T true true true c)
                  (T false true false d) (T true false false e) (T true true true t) in
        let r4 := flood n (T false false true t) (T true false true a) (T false true true b) r0
                  (T true false true t) (T false true true t) (T false false false f) in
        let r5 := flood n (T true false true t) r4 (T true true true b) r1
                  (T false false true d) (T true true true t) (T true false false f) in
        let r6 := flood n (T false true true t) (T true true true a) r4 r2
                  (T true true true t) (T false false true e) (T false true false f) in
        let r7 := flood n (T true true true t) r6 r5 r3 (T false true true d) (T true false true e) (T true true false f) in
        let r := Node 0 0 false r0 r1 r2 r3 r4 r5 r6 r7 in
        Node p q (has k r0 || has k r1 || has k r2 || has k r3 || has k r4 || has k r5 || has k r6 || has k r7)
          (T false false false r) (T true false false r) (T false true false r) (T true true false r)
          (T false false true r) (T true false true r) (T false true true r) (T true true true r)
      end
    else t
  end.
End Flood.

(** Leaves that are still to be reached. *)
Fixpoint rest (k : kind) (t : tree) : Z :=
  match t with
  | Cube k' => if same k k' then 1 else 0
  | Node _ _ some a b c d e f g h =>
    if some then add (rest k a) (add (rest k b) (add (rest k c) (add (rest k d)
                (add (rest k e) (add (rest k f) (add (rest k g) (rest k h)))))))
    else 0
  end.

(** Sweeps in all eight orders, until nothing is left or nothing changes. [out] is what is outside of the root. *)
Definition sweeps (k : kind) (out t : tree) : tree :=
  let once := fun i j l t => flood k i j l 20 t out out out out out out in
  once true true true (once true true false (once true false true (once true false false
 (once false true true (once false true false (once false false true (once false false false t))))))).
Fixpoint rounds (k : kind) (out : tree) (fuel : nat) (t : tree) (before : Z) : tree :=
  match fuel with
  | O => t
  | S n => let now := rest k t in if (now =? 0) || (now =? before) then t else rounds k out n (sweeps k out t) now
  end.

(** The leaf of kind k with the unit cell (u, v, w) becomes [Reached]; no other kind is changed. x, y, z, e are corner and edge. *)
Fixpoint mark (k : kind) (fuel : nat) (u v w x y z e : Z) (t : tree) : tree :=
  match t with
  | Cube k' => if same k k' then Cube Reached else t
  | Node p q r a b c d e' f g h =>
    match fuel with
    | O => t
    | S n =>
      let s := Z.shiftr e 1 in let x' := add x s in let y' := add y s in let z' := add z s in
      if w <? z' then
        if v <? y' then
          if u <? x' then Node p q r (mark k n u v w x y z s a) b c d e' f g h
          else Node p q r a (mark k n u v w x' y z s b) c d e' f g h
        else if u <? x' then Node p q r a b (mark k n u v w x y' z s c) d e' f g h
        else Node p q r a b c (mark k n u v w x' y' z s d) e' f g h
      else if v <? y' then
          if u <? x' then Node p q r a b c d (mark k n u v w x y z' s e') f g h
          else Node p q r a b c d e' (mark k n u v w x' y z' s f) g h
        else if u <? x' then Node p q r a b c d e' f (mark k n u v w x y' z' s g) h
        else Node p q r a b c d e' f g (mark k n u v w x' y' z' s h)
    end
  end.
(** The kind of the leaf with the unit cell (u, v, w). *)
Fixpoint spot (fuel : nat) (u v w x y z e : Z) (t : tree) : kind :=
  match t with
  | Cube k => k
  | Node _ _ _ a b c d e' f g h =>
    match fuel with
    | O => Empty
    | S n =>
      let s := Z.shiftr e 1 in let x' := add x s in let y' := add y s in let z' := add z s in
      if w <? z' then
        if v <? y' then if u <? x' then spot n u v w x y z s a else spot n u v w x' y z s b
        else if u <? x' then spot n u v w x y' z s c else spot n u v w x' y' z s d
      else
        if v <? y' then if u <? x' then spot n u v w x y z' s e' else spot n u v w x' y z' s f
        else if u <? x' then spot n u v w x y' z' s g else spot n u v w x' y' z' s h
    end
  end.

(** * Kept region *)

(** A cube is filled by leaves of kind k, or empty. *)
Fixpoint filled (k : kind) (t : tree) : bool :=
  match t with
  | Cube k' => same k k'
  | Node _ _ _ a b c d e f g h => filled k a && filled k b && filled k c && filled k d && filled k e && filled k f && filled k g && filled k h
  end.

(** Every leaf of t is filled with leaves of u of the kind [fate], or has none if that is [Empty]. *)
Section Overlay.
Variable fate : kind -> kind.
Fixpoint overlay (t u : tree) : bool :=
  match t with
  | Cube k => filled (fate k) u
  | Node _ _ _ a b c d e f g h =>
    match u with
    | Cube Empty | Node _ _ _ _ _ _ _ _ _ _ _ =>
      overlay a (kid false false false u) && overlay b (kid true false false u) && overlay c (kid false true false u) &&
      overlay d (kid true true false u) && overlay e (kid false false true u) && overlay f (kid true false true u) &&
      overlay g (kid false true true u) && overlay h (kid true true true u)
    | _ => false
    end
  end.
End Overlay.
