(** What the walks accept is least: an octant in a kept leaf of T0 is split if and only if it has a cause. So what [check_graded] accepts
    has its layers and is least. *)
From Coq Require Import ZArith List Bool Lia Permutation.
Import ListNotations.
From Proof Require Import Statement Checker Check Octants Pairs Unique Near Sources.
Open Scope Z_scope.

(** * Leastness *)

(** Cubes that touch. *)
Lemma axis_touch p e q f : 0 < e -> 0 < f -> gap p e q f = 0 -> exists u, p <= u < p + e /\ gap u 1 q f = 0.
Proof. intros. exists (Z.max p (Z.min (p + e - 1) q)). unfold gap in *. lia. Qed.
Lemma touch_gaps a b : touch a b -> gap (cx a) (edge a) (cx b) (edge b) = 0 /\ gap (cy a) (edge a) (cy b) (edge b) = 0 /\ gap (cz a) (edge a) (cz b) (edge b) = 0.
Proof.
  unfold touch, distance. assert (forall p e q f, 0 <= gap p e q f) as P by (intros; unfold gap; apply Z.le_max_l).
  pose proof (P (cx a) (edge a) (cx b) (edge b)). pose proof (P (cy a) (edge a) (cy b) (edge b)). pose proof (P (cz a) (edge a) (cz b) (edge b)).
  set (g1 := gap (cx a) _ _ _) in *. set (g2 := gap (cy a) _ _ _) in *. set (g3 := gap (cz a) _ _ _) in *. lia.
Qed.
Lemma gaps_touch a b : gap (cx a) (edge a) (cx b) (edge b) = 0 -> gap (cy a) (edge a) (cy b) (edge b) = 0 -> gap (cz a) (edge a) (cz b) (edge b) = 0 -> touch a b.
Proof. unfold touch, distance. intros -> -> ->. reflexivity. Qed.
Lemma axis_kid p e q n : 0 < e -> gap p e q (E (S n)) = 0 -> exists i, gap p e (q + off i n) (E n) = 0.
Proof.
  rewrite E_S. pose proof (E_pos n). intros P G. unfold gap in *. destruct (Z_le_dec p (q + E n)); [exists false | exists true]; cbn [off]; lia.
Qed.
Lemma kid_touch a X Y W n : octant a -> touch a (cube X Y W (S n)) -> exists i j k, touch a (cube (X + off i n) (Y + off j n) (W + off k n) n).
Proof.
  intros O T. apply edge_pos in O. apply touch_gaps in T. rewrite cube_edge in T. cbn [cube cx cy cz] in T. destruct T as (A & B & C).
  apply axis_kid in A, B, C; trivial. destruct A as [i A], B as [j B], C as [k C]. exists i, j, k. apply gaps_touch; rewrite cube_edge; assumption.
Qed.

Lemma same_cube_within a b o : same_cube a b -> within a o -> within b o.
Proof. intros (A & B & C & D) W u v w H. apply W. unfold holds, edge in *. rewrite A, B, C, D. exact H. Qed.
Lemma same_cube_octant a b : same_cube a b -> octant a -> octant b.
Proof. destruct a, b. unfold same_cube. cbn. intros (-> & -> & -> & ->) O. exact O. Qed.
Lemma same_cube_distance a b o : same_cube a b -> distance a o = distance b o.
Proof. destruct a, b. unfold same_cube. cbn. intros (-> & -> & -> & ->). reflexivity. Qed.
Lemma same_cube_early c base m d a b : same_cube a b -> split_early c base m d a -> split_early c base m d b.
Proof. destruct a, b. unfold same_cube. cbn. intros (-> & -> & -> & ->) O. exact O. Qed.
Lemma same_cube_child_of a b q : same_cube a b -> child_of a q -> child_of b q.
Proof. intros S (O & L & W). split; [exact O|]. split; [destruct S as (_ & _ & _ & <-); exact L | exact (same_cube_within a b q S W)]. Qed.
Lemma same_cube_sym a b : same_cube a b -> same_cube b a.
Proof. unfold same_cube. intuition. Qed.
Lemma same_cube_edge a b : same_cube a b -> edge a = edge b.
Proof. intros (_ & _ & _ & L). unfold edge. rewrite L. reflexivity. Qed.
Lemma one_parent o q r : octant o -> child_of o q -> child_of o r -> same_cube q r.
Proof.
  intros O (OQ & LQ & WQ) (OR & LR & WR). pose proof (corner_holds o O) as C. assert (level q = level r) as L by lia.
  destruct (same_level_cube q r _ _ _ OQ OR L (WQ _ _ _ C) (WR _ _ _ C)) as (X & Y & Z'). repeat split; assumption.
Qed.
Lemma edge_quarter a b : octant a -> octant b -> level a >= level b + 2 -> 4 * edge a <= edge b.
Proof.
  intros [A _] [B _] L. unfold edge. pose proof (cells_antitone (level b + 2) (level a)). rewrite (cells_double (level b)), (cells_double (level b + 1)) by lia.
  replace (level b + 1 + 1) with (level b + 2) by ring. lia.
Qed.
Lemma edge_half a b : octant a -> octant b -> level a >= level b + 1 -> 2 * edge a <= edge b.
Proof. intros [A _] [B _] L. unfold edge. apply cells_less; lia. Qed.

Section Least.
Variable c : inputs.
Variables base mesh dropped : list leaf.
Let graded := mesh ++ dropped.
Let s := cells (surface c).
Hypothesis Hs : 0 <= surface c <= 19.
Hypothesis G : region c base mesh dropped.

(** The marked leaves. *)
Variable V : list leaf.
Hypothesis to_marked : forall a, In a graded -> exists a', In a' V /\ same_cube a a'.
Hypothesis of_marked : forall a', In a' V -> exists a, In a graded /\ same_cube a a'.
Hypothesis marked : forall a, In a V -> 1 <= level a -> marked_right c base mesh dropped V a.
Hypothesis layered : forall a, In a V -> 1 <= level a -> side_of a = Outside -> served_right (layer_cells c) V a.
Hypothesis apart4 : forall a b, In a V -> In b V -> 4 * edge b <= edge a -> 0 < distance a b.
Hypothesis apart_late : forall a b, In a V -> In b V -> late_rule a b.
Hypothesis apart_source : forall a b, In a V -> In b V -> source_rule (layer_cells c) a b.
Hypothesis apart_extra : keep_crossing c = false -> layer_cells c < 3 -> forall a b, In a V -> In b graded -> extra_rule s a b.

Lemma marked_octant a : In a V -> octant a.
Proof. intros A. destruct (of_marked a A) as (b & B & S). apply (same_cube_octant b a S). apply (graded_octant c base mesh dropped G b B). Qed.

Lemma crossing_kept b : side_of b = Crossing -> ~ deleted c base b.
Proof. intros S [[_ D] | [[_ D] | (_ & _ & _ & D & _)]]; congruence. Qed.
(** A crossing leaf of T0 that touches an octant has a graded leaf that does. *)
Lemma crossing_touch a b : octant a -> In b base -> side_of b = Crossing -> touch b a -> exists r, In r graded /\ side_of r = Crossing /\ touch r a.
Proof.
  intros A B S T. pose proof (base_octant c base mesh dropped G b B) as OB. apply touch_gaps in T. destruct T as (X & Y & Z').
  pose proof (edge_pos a A) as PA. pose proof (edge_pos b OB) as PB.
  apply axis_touch in X; trivial. apply axis_touch in Y; trivial. apply axis_touch in Z'; trivial.
  destruct X as (u & HU & U), Y as (v & HV & V'), Z' as (w & HW & W').
  destruct (filled_by c base mesh dropped G b u v w B (crossing_kept b S) (conj HU (conj HV HW))) as (r & R & (RX & RY & RZ) & _ & SR).
  exists r. split; [exact R|]. split; [congruence|].
  assert (forall p e q f u, p <= u < p + e -> gap u 1 q f = 0 -> gap p e q f = 0) as GW by (clear; unfold gap; lia).
  apply gaps_touch; eapply GW; eassumption.
Qed.

(** A parent whose children are no sources is not split early. *)
Lemma quiet_not_early a q : quiet base V a -> octant a -> child_of a q -> ~ split_early c base mesh dropped q.
Proof.
  intros (X & Y & W & n & CH & K & NB) O CQ EQ. apply (same_cube_early _ _ _ _ _ _ (one_parent a q _ O CQ CH)) in EQ. clear q CQ.
  pose proof (proj1 CH) as OQ. set (q := cube X Y W (S n)) in *.
  destruct EQ as [(b & B & IN) | [(p & P & L & T) | (KC & N3 & L & b & B & S & T)]].
  - exact (NB b B IN).
  - apply kid_touch in T; [|exact (graded_octant c base mesh dropped G p P)]. destruct T as (i & j & k & T). specialize (K i j k). set (e := cube _ _ _ n) in *.
    destruct (to_marked p P) as (p' & P' & SP).
    assert (edge p' < edge e) as LT.
    { pose proof (edge_half p e (graded_octant c base mesh dropped G p P) (marked_octant e K)) as H. pose proof (edge_pos p (graded_octant c base mesh dropped G p P)).
      rewrite <- (same_cube_edge p p' SP). assert (level p >= level e + 1) by (unfold q in L; unfold e; cbn [level cube] in *; lia). lia. }
    pose proof (apart_late e p' K P' eq_refl LT) as D. rewrite distance_comm, <- (same_cube_distance p p' e SP), T in D. lia.
  - destruct (crossing_touch q b OQ B S T) as (r & R & SR & TR). apply kid_touch in TR; [|exact (graded_octant c base mesh dropped G r R)]. destruct TR as (i & j & k & TR).
    specialize (K i j k). set (e := cube _ _ _ n) in *.
    assert (s <= edge e) as LE by (unfold s, edge; apply cells_antitone; unfold q in L; unfold e; cbn [level cube] in *; lia).
    pose proof (apart_extra KC N3 e r K R SR (or_intror (conj LE eq_refl))) as D. rewrite distance_comm, TR in D. lia.
Qed.

Lemma source_of a : In a V -> side_of a = Crossing -> 1 <= level a -> exists p, source c base mesh dropped p /\ same_cube p a.
Proof.
  intros A S L. destruct (of_marked a A) as (p & P & SC). exists p. split; [|exact SC]. split; [exact P|].
  destruct (marked a A L) as (M & _). destruct (M S) as (q & CQ & EQ).
  apply (same_cube_child_of a p q (same_cube_sym p a SC)) in CQ. destruct CQ as (OQ & LQ & WQ). exists q. auto.
Qed.

Theorem least_right : Statement.least c base mesh dropped.
Proof.
  intros o b O B N W. split.
  - intros (a & A & IN). pose proof (graded_octant c base mesh dropped G a A) as OA. destruct IN as [WA LA].
    destruct (Z_le_dec (level o + 2) (level a)) as [L|L].
    { left; right; left. exists a. split; [exact A|]. split; [lia|]. apply inside_touch; [exact OA | split; assumption]. }
    destruct (to_marked a A) as (a' & A' & SA). pose proof (marked_octant a' A') as OA'.
    assert (level a' = level o + 1) as LA' by (destruct SA as (_ & _ & _ & <-); lia).
    assert (child_of a' o) as CO by (split; [exact O|]; split; [lia | exact (same_cube_within a a' o SA WA)]).
    assert (1 <= level a') as L1 by (destruct O; lia).
    destruct (marked a' A' L1) as (M1 & _ & M3). destruct (side_of a') eqn:SD; [| congruence |].
    + right. destruct (layered a' A' L1 SD) as (q & p' & CQ & P' & SP & LP & DI).
      destruct (source_of p' P' SP ltac:(lia)) as (p & PS & SC). exists p. split; [exact PS|].
      assert (level p = level p') as LPP by apply SC. split; [lia|].
      rewrite (same_cube_distance p p' o SC), LPP, distance_comm, (same_cube_distance o q p' (one_parent a' o q OA' CO CQ)), distance_comm. exact DI.
    + left. destruct (M1 eq_refl) as (q & CQ & EQ). exact (same_cube_early _ _ _ _ q o (one_parent a' q o OA' CQ CO) EQ).
  - intros CAUSE. pose proof (corner_holds o O) as C.
    destruct (filled_by c base mesh dropped G b _ _ _ B N (W _ _ _ C)) as (a & A & HA & WA & SA).
    pose proof (graded_octant c base mesh dropped G a A) as OA.
    destruct (Z_lt_dec (level o) (level a)) as [L|L].
    { exists a. split; [exact A|]. split; [|exact L]. apply (nested o a _ _ _ O OA) with (3 := HA); [lia | exact C]. }
    exfalso. assert (within o a) as WO by (apply (nested a o _ _ _ OA O) with (2 := HA); [lia | exact C]).
    destruct (to_marked a A) as (a' & A' & SC).
    assert (forall p, touch p o -> touch a p) as TA.
    { intros p T. unfold touch in T. rewrite distance_comm in T. exact (touch_within o a p O WO T). }
    destruct CAUSE as [[(b' & B' & IN) | [(p & P & LP & T) | (KC & N3 & LS & b' & B' & S & T)]] | (p & (P & q & OQ & LQ & WQ & EQ) & LP & DI)].
    + destruct IN as [WI LI]. pose proof (base_octant c base mesh dropped G b' B') as OB'. pose proof (corner_holds b' OB') as C'.
      rewrite (base_one c base mesh dropped G b' b _ _ _ B' B C' (W _ _ _ (WI _ _ _ C'))) in LI.
      pose proof (within_level o b O W). lia.
    + destruct (to_marked p P) as (p' & P' & SP). pose proof (edge_quarter p a (graded_octant c base mesh dropped G p P) OA ltac:(lia)) as E4.
      pose proof (apart4 a' p' A' P') as D. rewrite <- (same_cube_edge _ _ SP), <- (same_cube_edge _ _ SC) in D. specialize (D E4).
      rewrite <- (same_cube_distance a a' p' SC), distance_comm, <- (same_cube_distance p p' a SP), distance_comm, (TA p T) in D. lia.
    + destruct (crossing_touch o b' O B' S T) as (r & R & SR & TR).
      assert (s < edge a') as LT.
      { rewrite <- (same_cube_edge _ _ SC). pose proof (cells_less (level a) (surface c)). pose proof (cells_pos (surface c)). unfold s, edge. lia. }
      pose proof (apart_extra KC N3 a' r A' R SR (or_introl LT)) as D. rewrite <- (same_cube_distance a a' r SC), (TA r TR) in D. lia.
    + destruct (to_marked p P) as (p' & P' & SP). pose proof (graded_octant c base mesh dropped G p P) as OP.
      assert (1 <= level p') as L1 by (destruct SP as (_ & _ & _ & <-); destruct OQ; lia).
      destruct (marked p' P' L1) as (_ & M2 & M3). destruct (side_of p') eqn:SD; [| congruence |].
      * apply (quiet_not_early p' q (M2 eq_refl) (marked_octant p' P')); [|exact EQ].
        apply (same_cube_child_of p p' q SP). split; [exact OQ|]. split; assumption.
      * pose proof (apart_source a' p' A' P' SD) as D. rewrite <- (same_cube_edge _ _ SP), <- (same_cube_edge _ _ SC) in D.
        specialize (D (edge_half p a OP OA ltac:(lia))).
        rewrite <- (same_cube_distance a a' p' SC), distance_comm, <- (same_cube_distance p p' a SP) in D.
        rewrite distance_comm in DI. pose proof (distance_within o a p O WO) as DW. rewrite (distance_comm a p) in DW. unfold edge in D. lia.
Qed.
End Least.

(** * The whole of gradation *)

Strategy opaque [walk overlay flat deep mark_sources served].

Lemma if_true (b x : bool) : b = true -> (if b then x else true) = true -> x = true.
Proof. intros ->. trivial. Qed.

Lemma rest_right c t g rest : check_graded c t g rest = true -> rest tt = true.
Proof. unfold check_graded, both. intros H. apply andb_prop in H. destruct H as [_ H]. apply andb_prop in H. apply H. Qed.

Section Graded.
Variable c : inputs.
Variables base mesh dropped : list leaf.
Let graded := mesh ++ dropped.
Hypothesis G : region c base mesh dropped.
Hypothesis Hn : 1 <= layer_cells c <= 4096.
Hypothesis Hs : 0 <= surface c <= 19.
Variables t g : tree.
Variable s1 : side.
Variable fate : kind -> kind.
Hypothesis fate_empty : fate Empty = Empty.
Hypothesis T : deep 19 t.
Hypothesis LB : forall b, In b (flat s1 19 0 0 0 t) <-> In b base.
Hypothesis SG : sized Cross 19 g.
Hypothesis LG : forall a, In a (flat Outside 19 0 0 0 g) <-> In a graded.
Hypothesis OV : overlay fate t g = true.
Variable rest : unit -> bool.
Hypothesis OK : check_graded c t g rest = true.

Lemma root_octant : octant (cube 0 0 0 19).
Proof.
  split; [cbn; lia|]. rewrite cube_edge, E_root. cbn [cube cx cy cz]. do 3 (split; [apply Z.divide_0_r|]).
  intros u v w. unfold holds, in_root. rewrite cube_edge, E_root. cbn [cube cx cy cz]. replace (cells 0) with 524288 by reflexivity. lia.
Qed.
Lemma root_list L u : sized Cross 19 u -> (forall o, In o (flat Outside 19 0 0 0 u) -> In o L) -> lists Outside L 0 0 0 19 0 0 0 (Also u 0 0 0 Nobody) 19.
Proof.
  intros S I. split; [|unfold in_range; split; [lia|]; split; [lia|]; split; [lia|]; right; auto].
  constructor; [exact root_octant | exact S | exact I | constructor].
Qed.

Definition s := cells (surface c).
Lemma surface_right : Z.shiftr 524288 (surface c) = s.
Proof.
  unfold s, cells. rewrite Z.shiftr_div_pow2 by lia. change 524288 with (2 ^ 19). rewrite <- Z.pow_sub_r by lia. reflexivity.
Qed.
Lemma extra_right : extra c = true <-> keep_crossing c = false /\ layer_cells c < 3.
Proof. unfold extra. rewrite andb_true_iff, negb_true_iff, Z.ltb_lt. reflexivity. Qed.

Let m := mark_sources s (extra c) t g 524288 524288 0 0 0 (Also g 0 0 0 Nobody) false.
Let V := flat Outside 19 0 0 0 m.
Let n := layer_cells c.
Lemma parts : walk_marked n (Z.shiftr 2097152 (below c)) m = true /\ (extra c = true -> walk_extra s m g = true) /\ served n m 524288 524288 0 0 0 (Also m 0 0 0 Nobody) = true.
Proof.
  unfold check_graded in OK. cbv zeta in OK. rewrite surface_right in OK. unfold both in OK. apply andb_prop in OK. destruct OK as [A B].
  apply andb_prop in B. destruct B as [B _]. apply andb_prop in B. destruct B as [B C].
  split; [exact A|]. split; [|exact C]. intros X. exact (if_true _ _ X B).
Qed.

Lemma all_marked : sized Cross 19 m /\ (forall o, In o graded -> exists o', In o' V /\ same_cube o o') /\
  (forall o', In o' V -> exists o, In o graded /\ same_cube o o') /\ (parent g = true -> forall o, In o V -> marked_right c base mesh dropped V o).
Proof.
  assert (forall o, In o graded -> exists b, In b base /\ within o b /\ side_of o = side_of b) as HOME.
  { intros o O. destruct (home c base mesh dropped G o O) as (b & B & _ & W & S & _). exists b. auto. }
  pose proof (mark_right c base mesh dropped s (extra c) (conj Hs eq_refl) (proj1 extra_right) HOME (graded_octant c base mesh dropped G) s1 fate fate_empty
    19 g (sized_deep _ _ _ SG) SG t 0 0 0 0 0 0 (Also g 0 0 0 Nobody) 19 false root_octant T OV) as M. rewrite E_root in M. fold m in M.
  destruct M as (M1 & M2 & M3 & M4).
  - apply root_list; [exact SG|]. intros o. apply LG.
  - intros o. apply LG.
  - intros _ b. apply LB.
  - intros b B IN. apply LB in B. split; [|exact B]. destruct t as [k|]; [|exact I]. apply flat_cube in B. destruct B as (sd & _ & ->).
    destruct IN as [_ L]. cbn [level cube] in L. lia.
  - split; [exact M1|]. split; [intros o O; apply M2, LG, O|]. split; [|exact M4].
    intros o O. destruct (M3 o O) as (a & A & S). exists a. split; [apply LG; exact A | exact S].
Qed.
Lemma V_octant o : In o V -> octant o.
Proof.
  destruct all_marked as (_ & _ & M & _). intros O. destruct (M o O) as (a & A & S). apply (same_cube_octant a o S).
  exact (graded_octant c base mesh dropped G a A).
Qed.
Lemma m_parent : parent m = parent g.
Proof. unfold m. destruct g as [[]|]; try reflexivity. cbn [mark_sources]. destruct (_ || parent _); [reflexivity|]. destruct (_ && _); [rewrite twig_right; reflexivity | reflexivity]. Qed.
(** Only the root has no parent. *)
Lemma has_parent o : In o V -> 1 <= level o -> parent m = true.
Proof.
  intros O L. destruct (parent m) eqn:P; [reflexivity|]. exfalso. unfold V in O. destruct m as [k|]; [|discriminate].
  apply flat_cube in O. destruct O as (sd & _ & ->). cbn [level] in L. lia.
Qed.

Lemma all_pairs a b : In a V -> In b V -> marked_rule n (below c) a b.
Proof.
  pose proof (proj1 parts) as W. pose proof (proj1 all_marked) as M. revert a b.
  exact (walk_all Outside _ _ _ (marked_skip_right n (below c)) (marked_stop_right n Hn (below c)) m m M M W).
Qed.

Lemma layers_right : layers c mesh dropped.
Proof.
  intros l a b A B LT LA LB'. destruct all_marked as (M & TO & _). destruct (TO a A) as (a' & A' & SA). destruct (TO b B) as (b' & B' & SB).
  pose proof (graded_octant c base mesh dropped G a A) as [LE _].
  rewrite (same_cube_distance a a' b SA), distance_comm, (same_cube_distance b b' a' SB), distance_comm.
  refine (all_layers Outside m M n (below c) Hn _ (fun p q P Q => proj1 (all_pairs p q P Q)) l a' b' A' B' _ _ _).
  - unfold below. destruct (keep c); lia.
  - unfold below. destruct LT as [LT | ->]; [destruct (keep c)|]; lia.
  - destruct SA as (_ & _ & _ & <-). exact LA.
  - destruct SB as (_ & _ & _ & <-). exact LB'.
Qed.

Lemma gradation_least : Statement.least c base mesh dropped.
Proof.
  destruct all_marked as (M & TO & FROM & MARK).
  apply (least_right c base mesh dropped Hs G V TO FROM).
  - intros a A L. apply MARK; [|exact A]. rewrite <- m_parent. exact (has_parent a A L).
  - intros a A L SO. refine (all_served n Hn V V_octant 19 m (sized_deep _ _ _ M) M 0 0 0 0 0 0 (Also m 0 0 0 Nobody) 19 root_octant (root_list V m M (fun o O => O)) _ (has_parent a A L) a A SO).
    rewrite E_root. apply parts.
  - intros a b A B F. destruct (all_pairs a b A B) as (P & _). exact (proj2 (P F)).
  - intros a b A B. apply (all_pairs a b A B).
  - intros a b A B. apply (all_pairs a b A B).
  - intros KC N3 a b A B. destruct parts as (_ & P & _). specialize (P (proj2 extra_right (conj KC N3))). apply LG in B.
    assert (0 <= s) as S0 by (unfold s, cells; apply Z.pow_nonneg; lia).
    exact (walk_all Outside _ _ _ (extra_skip_right s) (extra_stop_right s) m g M SG P a b A B).
Qed.
End Graded.
