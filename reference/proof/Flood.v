(** Flood: a leaf that is [Reached] is connected to where the flood started. *)
From Coq Require Import ZArith List Bool Lia.
Import ListNotations.
From Proof Require Import Statement Checker Octants Pairs.
Open Scope Z_scope.

Lemma same_eq k k' : same k k' = true <-> k = k'.
Proof. destruct k, k'; simpl; split; congruence. Qed.

Lemma cube_holds h x y z s u v w : holds (Leaf x y z (19 - Z.of_nat h) s) u v w <-> in_cube h x y z u v w.
Proof. unfold holds, in_cube, edge. cbn [level cx cy cz]. rewrite E_cells. tauto. Qed.

Lemma look_in_kid n x y z u v w t i j k : in_cube n (x + off i n) (y + off j n) (z + off k n) u v w ->
  look (S n) x y z u v w t = look n (x + off i n) (y + off j n) (z + off k n) u v w (kid i j k t) /\ in_cube (S n) x y z u v w.
Proof.
  intros P. pose proof (E_pos n). unfold in_cube, off in *. split.
  - apply look_at; [destruct i | destruct j | destruct k]; lia.
  - rewrite E_S. destruct i, j, k; lia.
Qed.

Definition on (a : axis) (x y z : Z) := match a with X => x | Y => y | Z_ => z end.
Definition end_of (s : bool) (h : nat) := if s then E h - 1 else 0.
Lemma wet_right a s : forall fuel h t x y z, deep h t -> wet fuel a s t = true -> exists u v w,
  in_cube h x y z u v w /\ look h x y z u v w t = Reached /\ on a u v w = on a x y z + end_of s h.
Proof.
  assert (forall h k x y z, same Reached k = true -> exists u v w,
    in_cube h x y z u v w /\ look h x y z u v w (Cube k) = Reached /\ on a u v w = on a x y z + end_of s h) as CUBE.
  { intros h k x y z K. apply same_eq in K. subst k. pose proof (E_pos h).
    exists (x + dx a * end_of s h), (y + dy a * end_of s h), (z + dz a * end_of s h). rewrite look_cube.
    split; [|split; [reflexivity|]]; unfold in_cube, end_of; destruct a, s; cbn [dx dy dz on]; lia. }
  induction fuel as [| fuel IH]; intros h t x y z D H.
  - destruct t as [k|]; [apply CUBE; exact H | discriminate].
  - destruct t as [k | p0 q0 r0 t0 t1 t2 t3 t4 t5 t6 t7]; [apply CUBE; exact H|].
    set (t := Node p0 q0 r0 t0 t1 t2 t3 t4 t5 t6 t7) in *.
    assert (exists i j, wet fuel a s (kid_on a s i j t) = true) as (i & j & W).
    { cbn [wet] in H. apply orb_prop in H. destruct H as [H|H]; [apply orb_prop in H; destruct H as [H|H]; [apply orb_prop in H; destruct H as [H|H]|]|];
      eexists _, _; exact H. }
    destruct h as [| n]; [destruct D|]. pose proof (E_pos n).
    assert (exists i1 i2 i3, kid_on a s i j t = kid i1 i2 i3 t /\ on a x y z + off s n = on a (x + off i1 n) (y + off i2 n) (z + off i3 n))
      as (i1 & i2 & i3 & K & O).
    { destruct a; [exists s, i, j | exists i, s, j | exists i, j, s]; split; reflexivity. }
    rewrite K in W. destruct (IH n _ (x + off i1 n) (y + off i2 n) (z + off i3 n) (deep_Kid n t i1 i2 i3 D) W) as (u & v & w & P & L & F).
    destruct (look_in_kid n x y z u v w t i1 i2 i3 P) as [L' P']. exists u, v, w. split; [exact P'|]. split; [rewrite L'; exact L|].
    rewrite F, <- O. unfold end_of, off. rewrite E_S. destruct s; lia.
Qed.

Section Flood.
Variable s0 : side.
Variable k0 : kind.
Hypothesis K0 : side_in s0 k0 = Some s0.
(** The unit cells that are reached. *)
Variable R : Z -> Z -> Z -> Prop.

Definition truth h x y z t := forall u v w, in_cube h x y z u v w -> look h x y z u v w t = Reached -> R u v w.
Definition spreads (o : leaf) := forall u v w u' v' w', holds o u v w -> Z.abs (u - u') + Z.abs (v - v') + Z.abs (w - w') = 1 ->
  R u' v' w' -> forall p q r, holds o p q r -> R p q r.
Definition ready h x y z t := forall o, In o (flat s0 h x y z t) -> side_of o = s0 -> spreads o.
Definition good h x y z t := deep h t /\ truth h x y z t.

Lemma good_kid n x y z t i j k : good (S n) x y z t -> good n (x + off i n) (y + off j n) (z + off k n) (kid i j k t).
Proof.
  intros [D T]. split; [apply deep_Kid; exact D|]. intros u v w P L.
  destruct (look_in_kid n x y z u v w t i j k P) as [L' P']. apply T; [exact P' | congruence].
Qed.
Lemma good_node n x y z t : inner t -> (forall i j k, good n (x + off i n) (y + off j n) (z + off k n) (kid i j k t)) -> good (S n) x y z t.
Proof.
  intros T G. split.
  - apply deep_kid; [exact T|]. intros i j k. apply G.
  - intros u v w P L. destruct (look_kid n x y z u v w t) as (i & j & k & L' & A & B & C). rewrite L' in L.
    destruct (G i j k) as [_ G']. apply G'; [|exact L]. apply in_kid; assumption.
Qed.

Section Sweep.
Variables i j l : bool.
Definition back (s : bool) (n : nat) : Z := if s then E n else - E n.
Let turn := T i j l.

Lemma flood_node n t a b c d e f : inner t -> let r0 := flood k0 i j l (S n) t a b c d e f in has k0 t = false /\ r0 = t \/
  inner r0 /\ exists r, (forall x y z, kid (xorb i x) (xorb j y) (xorb l z) r0 = r x y z) /\
  forall x y z, r x y z = flood k0 i j l n (turn x y z t)
    (if x : bool then r false y z else turn true y z a) (if y : bool then r x false z else turn x true z b)
    (if z : bool then r x y false else turn x y true c)
    (if x then turn false y z d else turn true y z t) (if y then turn x false z e else turn x true z t)
    (if z then turn x y false f else turn x y true t).
Proof.
  destruct t as [| p q some t0 t1 t2 t3 t4 t5 t6 t7]; [contradiction|]. intros _. cbv zeta. cbn [flood has].
  destruct some; [right | left; auto]. split; [exact I|].
  set (t := Node p q true t0 t1 t2 t3 t4 t5 t6 t7).
  set (F := flood k0 i j l n). fold turn.
  set (r0 := F _ _ _ _ _ _ _). set (r1 := F _ r0 _ _ _ _ _). set (r2 := F _ _ r0 _ _ _ _). set (r3 := F _ r2 r1 _ _ _ _).
  set (r4 := F _ _ _ r0 _ _ _). set (r5 := F _ r4 _ r1 _ _ _). set (r6 := F _ _ r4 r2 _ _ _). set (r7 := F _ r6 r5 r3 _ _ _).
  exists (fun x y z : bool => if z then if y then if x then r7 else r6 else if x then r5 else r4
                              else if y then if x then r3 else r2 else if x then r1 else r0).
  split.
  - intros x y z. unfold turn, T. destruct i, j, l, x, y, z; reflexivity.
  - intros x y z. destruct x, y, z; reflexivity.
Qed.

Lemma flood_right : forall fuel h t a b c d e f x y z, ready h x y z t -> good h x y z t ->
  good h (x + back i h) y z a -> good h x (y + back j h) z b -> good h x y (z + back l h) c ->
  good h (x + back (negb i) h) y z d -> good h x (y + back (negb j) h) z e -> good h x y (z + back (negb l) h) f ->
  let r := flood k0 i j l fuel t a b c d e f in good h x y z r /\ flat s0 h x y z r = flat s0 h x y z t.
Proof.
  assert (forall fuel h k a b c d e f x y z, ready h x y z (Cube k) ->
    good h (x + back i h) y z a -> good h x (y + back j h) z b -> good h x y (z + back l h) c ->
    good h (x + back (negb i) h) y z d -> good h x (y + back (negb j) h) z e -> good h x y (z + back (negb l) h) f ->
    let r := flood k0 i j l fuel (Cube k) a b c d e f in
    r = Cube k \/ (r = Cube Reached /\ k = k0 /\ forall u v w, in_cube h x y z u v w -> R u v w)) as CUBE.
  { intros fuel h k a b c d e f x y z RD [Da Ta] [Db Tb] [Dc Tc] [Dd Td] [De Te] [Df Tf]. cbv zeta.
    replace (flood k0 i j l fuel (Cube k) a b c d e f) with
      (if same k0 k then if wet 20 X (negb i) a || wet 20 Y (negb j) b || wet 20 Z_ (negb l) c || wet 20 X i d || wet 20 Y j e || wet 20 Z_ l f
        then Cube Reached else Cube k else Cube k) by (destruct fuel; reflexivity).
    destruct (same k0 k) eqn:K; [|left; reflexivity]. apply same_eq in K. subst k.
    match goal with |- context [if ?w then _ else _] => destruct w eqn:W end; [right | left; reflexivity].
    split; [reflexivity|]. split; [reflexivity|].
    assert (spreads (Leaf x y z (19 - Z.of_nat h) s0)) as SP.
    { apply RD; [|reflexivity]. apply flat_cube. exists s0. auto. }
    pose proof (E_pos h) as PE.
    assert (exists u v w u' v' w', in_cube h x y z u v w /\ Z.abs (u - u') + Z.abs (v - v') + Z.abs (w - w') = 1 /\ R u' v' w')
      as (u & v & w & u' & v' & w' & P & N & RR).
    { repeat (apply orb_prop in W; destruct W as [W|W]).
      - apply (wet_right X _ _ h _ (x + back i h) y z Da) in W. destruct W as (u & v & w & P & L & O). pose proof (Ta u v w P L) as RR.
        exists (if i then u - 1 else u + 1), v, w, u, v, w. split; [|split; [destruct i; lia | exact RR]].
        unfold in_cube, on, back, end_of in *. destruct i; cbn [negb] in *; lia.
      - apply (wet_right Y _ _ h _ x (y + back j h) z Db) in W. destruct W as (u & v & w & P & L & O). pose proof (Tb u v w P L) as RR.
        exists u, (if j then v - 1 else v + 1), w, u, v, w. split; [|split; [destruct j; lia | exact RR]].
        unfold in_cube, on, back, end_of in *. destruct j; cbn [negb] in *; lia.
      - apply (wet_right Z_ _ _ h _ x y (z + back l h) Dc) in W. destruct W as (u & v & w & P & L & O). pose proof (Tc u v w P L) as RR.
        exists u, v, (if l then w - 1 else w + 1), u, v, w. split; [|split; [destruct l; lia | exact RR]].
        unfold in_cube, on, back, end_of in *. destruct l; cbn [negb] in *; lia.
      - apply (wet_right X _ _ h _ (x + back (negb i) h) y z Dd) in W. destruct W as (u & v & w & P & L & O). pose proof (Td u v w P L) as RR.
        exists (if i then u + 1 else u - 1), v, w, u, v, w. split; [|split; [destruct i; lia | exact RR]].
        unfold in_cube, on, back, end_of in *. destruct i; cbn [negb] in *; lia.
      - apply (wet_right Y _ _ h _ x (y + back (negb j) h) z De) in W. destruct W as (u & v & w & P & L & O). pose proof (Te u v w P L) as RR.
        exists u, (if j then v + 1 else v - 1), w, u, v, w. split; [|split; [destruct j; lia | exact RR]].
        unfold in_cube, on, back, end_of in *. destruct j; cbn [negb] in *; lia.
      - apply (wet_right Z_ _ _ h _ x y (z + back (negb l) h) Df) in W. destruct W as (u & v & w & P & L & O). pose proof (Tf u v w P L) as RR.
        exists u, v, (if l then w + 1 else w - 1), u, v, w. split; [|split; [destruct l; lia | exact RR]].
        unfold in_cube, on, back, end_of in *. destruct l; cbn [negb] in *; lia. }
    intros p q r Q. apply (SP u v w u' v' w'); [apply cube_holds; exact P | exact N | exact RR | apply cube_holds; exact Q]. }
  induction fuel as [| fuel IH]; intros h t a b c d e f x y z RD G Ga Gb Gc Gd Ge Gf; cbv zeta.
  - destruct t as [k|].
    + destruct (CUBE O h k a b c d e f x y z RD Ga Gb Gc Gd Ge Gf) as [-> | (-> & -> & A)]; [auto|]. split.
      * split; [destruct h; exact I | intros u v w P _; apply A; exact P].
      * destruct h; cbn [flat]; rewrite K0; reflexivity.
    + cbn [flood]. match goal with |- context [if ?w then _ else _] => destruct w end; auto.
  - destruct t as [k | p0 q0 r0 t0 t1 t2 t3 t4 t5 t6 t7].
    + destruct (CUBE (S fuel) h k a b c d e f x y z RD Ga Gb Gc Gd Ge Gf) as [-> | (-> & -> & A)]; [auto|]. split.
      * split; [destruct h; exact I | intros u v w P _; apply A; exact P].
      * destruct h; cbn [flat]; rewrite K0; reflexivity.
    + set (t := Node p0 q0 r0 t0 t1 t2 t3 t4 t5 t6 t7) in *. assert (inner t) as IT by exact I. clearbody t.
      destruct h as [| n]; [destruct (deep_O t IT (proj1 G))|].
      destruct (flood_node fuel t a b c d e f IT) as [[_ ->] | (IR & r & RK & RN)]; [auto|].
      set (res := flood k0 i j l (S fuel) t a b c d e f) in *. clearbody res.
      set (px := fun s => x + off (xorb i s) n). set (py := fun s => y + off (xorb j s) n). set (pz := fun s => z + off (xorb l s) n).
      assert (forall x1 y1 z1, (x1 = true -> good n (px false) (py y1) (pz z1) (r false y1 z1)) ->
        (y1 = true -> good n (px x1) (py false) (pz z1) (r x1 false z1)) -> (z1 = true -> good n (px x1) (py y1) (pz false) (r x1 y1 false)) ->
        good n (px x1) (py y1) (pz z1) (r x1 y1 z1) /\
        flat s0 n (px x1) (py y1) (pz z1) (r x1 y1 z1) = flat s0 n (px x1) (py y1) (pz z1) (turn x1 y1 z1 t)) as STEP.
      { intros x1 y1 z1 HX HY HZ. rewrite RN. pose proof (E_S n) as ES.
        apply IH.
        - intros o O. apply RD. apply in_flat; [exact IT|]. eexists _, _, _. exact O.
        - apply (good_kid n x y z t). exact G.
        - destruct x1.
          + replace (px true + back i n) with (px false) by (unfold px, off, back; destruct i; cbn [xorb]; lia). apply HX. reflexivity.
          + replace (px false + back i n) with (x + back i (S n) + off (xorb i true) n)
              by (unfold px, off, back; rewrite ES; destruct i; cbn [xorb]; lia). apply (good_kid n _ y z a). exact Ga.
        - destruct y1.
          + replace (py true + back j n) with (py false) by (unfold py, off, back; destruct j; cbn [xorb]; lia). apply HY. reflexivity.
          + replace (py false + back j n) with (y + back j (S n) + off (xorb j true) n)
              by (unfold py, off, back; rewrite ES; destruct j; cbn [xorb]; lia). apply (good_kid n x _ z b). exact Gb.
        - destruct z1.
          + replace (pz true + back l n) with (pz false) by (unfold pz, off, back; destruct l; cbn [xorb]; lia). apply HZ. reflexivity.
          + replace (pz false + back l n) with (z + back l (S n) + off (xorb l true) n)
              by (unfold pz, off, back; rewrite ES; destruct l; cbn [xorb]; lia). apply (good_kid n x y _ c). exact Gc.
        - destruct x1.
          + replace (px true + back (negb i) n) with (x + back (negb i) (S n) + off (xorb i false) n)
              by (unfold px, off, back; rewrite ES; destruct i; cbn [xorb negb]; lia). apply (good_kid n _ y z d). exact Gd.
          + replace (px false + back (negb i) n) with (x + off (xorb i true) n)
              by (unfold px, off, back; destruct i; cbn [xorb negb]; lia). apply (good_kid n x y z t). exact G.
        - destruct y1.
          + replace (py true + back (negb j) n) with (y + back (negb j) (S n) + off (xorb j false) n)
              by (unfold py, off, back; rewrite ES; destruct j; cbn [xorb negb]; lia). apply (good_kid n x _ z e). exact Ge.
          + replace (py false + back (negb j) n) with (y + off (xorb j true) n)
              by (unfold py, off, back; destruct j; cbn [xorb negb]; lia). apply (good_kid n x y z t). exact G.
        - destruct z1.
          + replace (pz true + back (negb l) n) with (z + back (negb l) (S n) + off (xorb l false) n)
              by (unfold pz, off, back; rewrite ES; destruct l; cbn [xorb negb]; lia). apply (good_kid n x y _ f). exact Gf.
          + replace (pz false + back (negb l) n) with (z + off (xorb l true) n)
              by (unfold pz, off, back; destruct l; cbn [xorb negb]; lia). apply (good_kid n x y z t). exact G. }
      clear IH RN RD Ga Gb Gc Gd Ge Gf CUBE.
      assert (forall x1 y1 z1, good n (px x1) (py y1) (pz z1) (r x1 y1 z1)) as GR.
      { pose proof (fun A B C => proj1 (STEP false false false A B C)) as G0. specialize (G0 ltac:(discriminate) ltac:(discriminate) ltac:(discriminate)).
        pose proof (fun B C => proj1 (STEP true false false (fun _ => G0) B C)) as G1. specialize (G1 ltac:(discriminate) ltac:(discriminate)).
        pose proof (fun A C => proj1 (STEP false true false A (fun _ => G0) C)) as G2. specialize (G2 ltac:(discriminate) ltac:(discriminate)).
        pose proof (fun C => proj1 (STEP true true false (fun _ => G2) (fun _ => G1) C)) as G3. specialize (G3 ltac:(discriminate)).
        pose proof (fun A B => proj1 (STEP false false true A B (fun _ => G0))) as G4. specialize (G4 ltac:(discriminate) ltac:(discriminate)).
        pose proof (fun B => proj1 (STEP true false true (fun _ => G4) B (fun _ => G1))) as G5. specialize (G5 ltac:(discriminate)).
        pose proof (fun A => proj1 (STEP false true true A (fun _ => G4) (fun _ => G2))) as G6. specialize (G6 ltac:(discriminate)).
        pose proof (proj1 (STEP true true true (fun _ => G6) (fun _ => G5) (fun _ => G3))) as G7.
        intros x1 y1 z1. destruct x1, y1, z1; assumption. }
      assert (forall i1 j1 k1, good n (x + off i1 n) (y + off j1 n) (z + off k1 n) (kid i1 j1 k1 res) /\
        flat s0 n (x + off i1 n) (y + off j1 n) (z + off k1 n) (kid i1 j1 k1 res) =
        flat s0 n (x + off i1 n) (y + off j1 n) (z + off k1 n) (kid i1 j1 k1 t)) as KID.
      { intros i1 j1 k1. specialize (RK (xorb i i1) (xorb j j1) (xorb l k1)).
        destruct (STEP (xorb i i1) (xorb j j1) (xorb l k1)) as [A B]; [intros; apply GR ..|].
        unfold px, py, pz, turn, T in *.
        rewrite <- !xorb_assoc_reverse, !xorb_nilpotent, !xorb_false_l in *. rewrite RK. split; [exact A | exact B]. }
      split.
      * apply good_node; [exact IR|]. intros. apply KID.
      * rewrite !flat_kids by assumption. clear - KID. induction corners as [| [[i1 j1] k1] rest IH]; [reflexivity|].
        cbn [flat_map]. rewrite IH. f_equal. apply KID.
Qed.
End Sweep.

(** Sweeps through the root. *)
Variable all : list leaf.
Hypothesis all_spread : forall o, In o all -> side_of o = s0 -> spreads o.
Definition kept_leaves h t := good h 0 0 0 t /\ flat s0 h 0 0 0 t = all.
Definition good_out h t := forall s, good h (0 + back s h) 0 0 t /\ good h 0 (0 + back s h) 0 t /\ good h 0 0 (0 + back s h) t.

Lemma sweep_right h fuel out i j l t : good_out h out -> kept_leaves h t -> kept_leaves h (flood k0 i j l fuel t out out out out out out).
Proof.
  intros O [G F]. assert (ready h 0 0 0 t) as RD by (intros o A; apply all_spread; rewrite <- F; exact A).
  pose proof (flood_right i j l fuel h t out out out out out out 0 0 0 RD G (proj1 (O i)) (proj1 (proj2 (O j))) (proj2 (proj2 (O l)))
    (proj1 (O (negb i))) (proj1 (proj2 (O (negb j)))) (proj2 (proj2 (O (negb l))))) as N. cbv zeta in N.
  destruct N as [G' F']. split; [exact G' | rewrite F'; exact F].
Qed.
Lemma sweeps_right h out t : good_out h out -> kept_leaves h t -> kept_leaves h (sweeps k0 out t).
Proof. intros O K. unfold sweeps. cbv zeta. generalize 20%nat as fuel. intros fuel. do 8 (apply sweep_right; [exact O|]). exact K. Qed.
Lemma rounds_right h out : good_out h out -> forall fuel t before, kept_leaves h t -> kept_leaves h (rounds k0 out fuel t before).
Proof.
  intros O. induction fuel as [| fuel IH]; intros t before K; [exact K|]. cbn [rounds]. cbv zeta.
  destruct (_ || _); [exact K|]. apply IH. apply sweeps_right; assumption.
Qed.

(** Seeds. *)
Lemma mark_node n t u v w x y z : inner t -> 0 <= x -> x + E n <= 1048576 -> 0 <= y -> y + E n <= 1048576 -> 0 <= z -> z + E n <= 1048576 ->
  exists i j k, (if i : bool then x + E n <= u else u < x + E n) /\ (if j : bool then y + E n <= v else v < y + E n) /\
    (if k : bool then z + E n <= w else w < z + E n) /\
    spot (S n) u v w x y z (E (S n)) t = spot n u v w (x + off i n) (y + off j n) (z + off k n) (E n) (kid i j k t) /\
    let r := mark k0 (S n) u v w x y z (E (S n)) t in
    inner r /\ kid i j k r = mark k0 n u v w (x + off i n) (y + off j n) (z + off k n) (E n) (kid i j k t) /\
    forall i' j' k', (i', j', k') <> (i, j, k) -> kid i' j' k' r = kid i' j' k' t.
Proof.
  destruct t as [| p q r a b c d e f g h]; [contradiction|]. intros _ X0 X1 Y0 Y1 Z0 Z1. pose proof (E_pos n).
  cbn [spot mark]. rewrite half. cbv zeta.
  rewrite (add_small x), (add_small y), (add_small z) by (unfold small; lia).
  exists (x + E n <=? u), (y + E n <=? v), (z + E n <=? w).
  destruct (Z.leb_spec (x + E n) u), (Z.leb_spec (y + E n) v), (Z.leb_spec (z + E n) w);
  destruct (Z.ltb_spec w (z + E n)); try lia; destruct (Z.ltb_spec v (y + E n)); try lia; destruct (Z.ltb_spec u (x + E n)); try lia;
  cbn [kid off inner]; rewrite ?Z.add_0_r; (repeat (split; [trivial|]));
  intros i' j' k' N; destruct i', j', k'; trivial; congruence.
Qed.

Lemma spot_right u v w : forall h t, deep h t -> forall x y z, 0 <= x -> x + E h <= 524288 -> 0 <= y -> y + E h <= 524288 -> 0 <= z -> z + E h <= 524288 ->
  in_cube h x y z u v w -> spot h u v w x y z (E h) t = look h x y z u v w t.
Proof.
  by_tree.
  - intros h k x y z _ _ _ _ _ _ _. destruct h; reflexivity.
  - intros n t T _ IH x y z X0 X1 Y0 Y1 Z0 Z1 P. rewrite E_S in *. pose proof (E_pos n).
    destruct (mark_node n t u v w x y z T) as (i & j & k & A & B & C & S & _); try lia. rewrite E_S in S. rewrite S.
    rewrite (look_at n x y z u v w t i j k A B C).
    apply IH; try (unfold off; destruct i, j, k; lia). apply in_kid; assumption.
Qed.

Lemma mark_right u v w : forall h t, deep h t -> forall x y z, 0 <= x -> x + E h <= 524288 -> 0 <= y -> y + E h <= 524288 -> 0 <= z -> z + E h <= 524288 ->
  in_cube h x y z u v w -> good h x y z t ->
  (forall o, In o (flat s0 h x y z t) -> side_of o = s0 -> holds o u v w -> forall p q r, holds o p q r -> R p q r) ->
  let r := mark k0 h u v w x y z (E h) t in good h x y z r /\ flat s0 h x y z r = flat s0 h x y z t.
Proof.
  by_tree.
  - intros h k x y z _ _ _ _ _ _ P G S. cbv zeta.
    replace (mark k0 h u v w x y z (E h) (Cube k)) with (if same k0 k then Cube Reached else Cube k) by (destruct h; reflexivity).
    destruct (same k0 k) eqn:K; [|auto]. apply same_eq in K. subst k. split.
    + split; [destruct h; exact I|]. intros p q r Q _. apply (S (Leaf x y z (19 - Z.of_nat h) s0)); [apply flat_cube; exists s0; auto | reflexivity | |];
      apply (proj2 (cube_holds _ _ _ _ _ _ _ _)); assumption.
    + destruct h; cbn [flat]; rewrite K0; reflexivity.
  - intros n t T _ IH x y z X0 X1 Y0 Y1 Z0 Z1 P G S. cbv zeta. pose proof (E_pos n).
    destruct (mark_node n t u v w x y z T) as (i & j & k & A & B & C & _ & M); try (rewrite E_S in *; lia). cbv zeta in M.
    destruct M as (IR & MK & MO). set (r := mark k0 (Datatypes.S n) u v w x y z (E (Datatypes.S n)) t) in *. clearbody r.
    pose proof (in_kid n x y z u v w i j k P A B C) as P'. rewrite E_S in *.
    assert (good n (x + off i n) (y + off j n) (z + off k n) (kid i j k r) /\
      flat s0 n (x + off i n) (y + off j n) (z + off k n) (kid i j k r) = flat s0 n (x + off i n) (y + off j n) (z + off k n) (kid i j k t)) as HK.
    { rewrite MK. apply IH; try (unfold off; destruct i, j, k; lia); [exact P' | apply (good_kid n x y z t); exact G |].
      intros o O. apply S. apply in_flat; [exact T | exists i, j, k; exact O]. }
    assert (forall i' j' k', good n (x + off i' n) (y + off j' n) (z + off k' n) (kid i' j' k' r) /\
      flat s0 n (x + off i' n) (y + off j' n) (z + off k' n) (kid i' j' k' r) =
      flat s0 n (x + off i' n) (y + off j' n) (z + off k' n) (kid i' j' k' t)) as KID.
    { intros i' j' k'. assert ((i', j', k') = (i, j, k) \/ (i', j', k') <> (i, j, k)) as [Q | Q]
        by (destruct i, j, k, i', j', k'; first [left; reflexivity | right; discriminate]).
      - injection Q as -> -> ->. exact HK.
      - rewrite (MO i' j' k' Q). split; [apply (good_kid n x y z t); exact G | reflexivity]. }
    split.
    + apply good_node; [exact IR|]. intros. apply KID.
    + rewrite !flat_kids by assumption. clear - KID. induction corners as [| [[i1 j1] k1] rest IH]; [reflexivity|].
      cbn [flat_map]. rewrite IH. f_equal. apply KID.
Qed.
End Flood.
